#include "zone/service/zone_service.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/error.h"
#include "common/sqlite.h"

namespace livemap::zone {

ZoneService::ZoneService(Config config, Clock now_ns, std::uint64_t uuid_seed)
    : config_(CheckedConfig(std::move(config))),
      now_ns_(std::move(now_ns)),
      directory_(config_.directory),
      state_(config_, directory_.path(), uuid_seed),
      images_(directory_.path() + "/images", static_cast<std::uint64_t>(config_.image_cap_bytes)),
      vehicles_(config_.vehicle_retention_s, config_.max_vehicles),
      allowance_(config_.allowance),
      steps_(config_, state_),
      reports_(config_, state_, steps_, images_, allowance_),
      map_changes_(config_, state_),
      polls_(config_, state_, steps_, images_, allowance_, vehicles_),
      officials_(config_, state_, steps_),
      ageing_(state_, steps_) {
  statistics_.store_damage = state_.damage;
  const std::int64_t now = now_ns_();
  for (Slot slot = 0; slot < state_.hazards.size(); ++slot) {
    const HazardRecord& record = state_.hazards.Record(slot);
    if (IsOnMap(record.life.state)) images_.Retain(record.picture.Sha256());
    Schedule(slot, now);
  }
}

ZoneService::~ZoneService() = default;

template <typename Body>
void ZoneService::Commit(ZoneTransaction& transaction, const Body& body) {
  try {
    transaction.Run(body);
  } catch (const StoreError&) {
    ++store_errors_;
    throw;
  }
}

void ZoneService::FollowUp(const ZoneTransaction& transaction) {
  for (const auto& [before, after] : transaction.pictures()) {
    images_.Retain(after);
    images_.Release(before);
  }
  images_.EvictBeyondCap();
  for (const Slot slot : transaction.touched()) Schedule(slot, transaction.now_ns());
  for (const HazardEvent& event : transaction.hazard_events()) {
    ZoneEvent message;
    message.hazard = event;
    stream_.Publish(message);
  }
  for (const MapChangeEvent& event : transaction.map_change_events()) {
    ZoneEvent message;
    message.map_change = event;
    stream_.Publish(message);
  }
}

/// When time changes the hazard next, and when vehicles are to be asked about it.
void ZoneService::Schedule(Slot slot, std::int64_t now_ns) {
  ageing_.Schedule(slot);
  polls_.SetHazard(slot, now_ns);
}

protocol::Receipt ZoneService::Handle(const protocol::Report& report) {
  std::vector<protocol::Receipt> receipts = HandleBatch({report});
  if (receipts.empty()) throw Error("too many reports of this vehicle within an hour");
  return std::move(receipts.front());
}

std::vector<protocol::Receipt> ZoneService::HandleBatch(
    const std::vector<protocol::Report>& reports) {
  const MutexLock writer(writer_mutex_);
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  ReportIntake::Batch batch = reports_.Examine(reports, transaction.now_ns());
  {
    const WriterLock lock(data_mutex_);
    if (!batch.pending.empty()) {
      Commit(transaction, [&] {
        writer_mutex_.AssertHeld();
        reports_.Apply(batch, transaction);
      });
    }
    CountReports(batch.counted);
  }
  reports_.KeepTracks(batch);
  FollowUp(transaction);
  return batch.TakeReceipts();
}

void ZoneService::CountReports(const ZoneStatistics& counted) {
  statistics_.added += counted.added;
  statistics_.merged += counted.merged;
  statistics_.repeated += counted.repeated;
  statistics_.refused += counted.refused;
  statistics_.not_now += counted.not_now;
  for (std::size_t i = 0; i < kRefusalKinds; ++i) {
    statistics_.refused_by_kind[i] += counted.refused_by_kind[i];
  }
}

std::vector<protocol::Receipt> ZoneService::HandleMapChanges(
    const std::vector<protocol::MapChangeReport>& reports) {
  const MutexLock writer(writer_mutex_);
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  MapChangeIntake::Batch batch = map_changes_.Examine(reports, transaction.now_ns());
  {
    const WriterLock lock(data_mutex_);
    if (!batch.pending.empty()) {
      Commit(transaction, [&] {
        writer_mutex_.AssertHeld();
        map_changes_.Apply(batch, transaction);
      });
    }
    CountMapChanges(batch.counted);
  }
  FollowUp(transaction);
  return batch.TakeReceipts();
}

void ZoneService::CountMapChanges(const MapChangeStatistics& counted) {
  MapChangeStatistics& all = statistics_.map_changes;
  all.added += counted.added;
  all.merged += counted.merged;
  all.denied += counted.denied;
  all.known += counted.known;
  all.repeated += counted.repeated;
  all.refused += counted.refused;
  all.not_now += counted.not_now;
}

std::vector<protocol::Poll> ZoneService::TakeDuePolls() {
  const MutexLock writer(writer_mutex_);
  std::vector<protocol::Poll> polls = polls_.TakeDue(now_ns_());
  const WriterLock lock(data_mutex_);
  statistics_.polls += polls.size();
  return polls;
}

bool ZoneService::HandleAnswer(const protocol::PollAnswer& answer) {
  const MutexLock writer(writer_mutex_);
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  const auto accepted = polls_.Accept(answer, transaction.now_ns());
  if (accepted) {
    const WriterLock lock(data_mutex_);
    Commit(transaction, [&] { polls_.Apply(*accepted, transaction); });
  }
  CountAnswer(accepted.has_value());
  if (!accepted) return false;
  polls_.Close(*accepted, transaction.now_ns());
  FollowUp(transaction);
  Schedule(accepted->slot, transaction.now_ns());
  return true;
}

void ZoneService::CountAnswer(bool accepted) {
  const WriterLock lock(data_mutex_);
  ++(accepted ? statistics_.answers : statistics_.answers_refused);
}

void ZoneService::Advance() {
  const MutexLock writer(writer_mutex_);
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  const std::vector<Slot> due = ageing_.TakeDue(transaction.now_ns());
  if (due.empty()) return;
  try {
    const WriterLock lock(data_mutex_);
    Commit(transaction, [&] {
      writer_mutex_.AssertHeld();
      ageing_.Apply(due, transaction);
    });
  } catch (...) {
    ageing_.PutBack(due, transaction.now_ns());
    throw;
  }
  ageing_.Reschedule(due, transaction.now_ns());
  FollowUp(transaction);
}

template <typename Decide>
bool ZoneService::DecideHazard(const Decide& decide) {
  const MutexLock writer(writer_mutex_);
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  const std::optional<OfficialActions::HazardDecision> decision = decide(transaction.now_ns());
  if (!decision) return false;
  {
    const WriterLock lock(data_mutex_);
    Commit(transaction, [&] { officials_.Apply(*decision, transaction); });
  }
  FollowUp(transaction);
  return true;
}

bool ZoneService::Confirm(const Uuid& hazard, const std::string& official,
                          const std::string& reason) {
  const std::string why = officials_.CheckedReason(official, reason);
  return DecideHazard(
      [&](std::int64_t now_ns) { return officials_.Confirm(hazard, official, why, now_ns); });
}

bool ZoneService::Reject(const Uuid& hazard, const std::string& official,
                         const std::string& reason) {
  const std::string why = officials_.CheckedReason(official, reason);
  return DecideHazard(
      [&](std::int64_t now_ns) { return officials_.Reject(hazard, official, why, now_ns); });
}

bool ZoneService::Remove(const Uuid& hazard, const std::string& reason) {
  return DecideHazard(
      [&](std::int64_t now_ns) { return officials_.Remove(hazard, reason, now_ns); });
}

bool ZoneService::ConfirmMapChange(const Uuid& uuid, const std::string& official,
                                   const std::string& reason) {
  return DecideMapChange(uuid, MapChangeState::kConfirmed, official, reason);
}

bool ZoneService::DismissMapChange(const Uuid& uuid, const std::string& official,
                                   const std::string& reason) {
  return DecideMapChange(uuid, MapChangeState::kDismissed, official, reason);
}

bool ZoneService::DecideMapChange(const Uuid& uuid, MapChangeState to, const std::string& official,
                                  const std::string& reason) {
  const std::string why = officials_.CheckedReason(official, reason);
  const MutexLock writer(writer_mutex_);
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  {
    const WriterLock lock(data_mutex_);
    Commit(transaction, [&] { officials_.DecideMapChange(uuid, to, official, why, transaction); });
  }
  FollowUp(transaction);
  return !transaction.map_change_events().empty();
}

std::optional<std::size_t> ZoneService::Distrust(const std::string& vehicle_id,
                                                 const std::string& official,
                                                 const std::string& reason) {
  // Reports wait while a portion is committed.
  constexpr std::size_t kMaxAtOnce = 2000;
  const std::string given = officials_.CheckedReason(official, reason);
  if (!IsPrintableText(vehicle_id, config_.limits.max_text_bytes)) return std::nullopt;
  const std::string why = DecisionText("words of " + vehicle_id + " withdrawn", official, given);
  const std::uint64_t vehicle = VehicleKey(vehicle_id);
  std::size_t withdrawn = 0;
  for (bool first = true;; first = false) {
    const MutexLock writer(writer_mutex_);
    std::vector<Slot> slots = StateForWriter().hazards.HazardsWithEvidenceFrom(vehicle);
    if (first && slots.empty() && vehicles_.Track(vehicle_id).empty() &&
        !reports_.HasHeardOf(vehicle_id)) {
      return std::nullopt;
    }
    const bool last = slots.size() <= kMaxAtOnce;
    slots.resize(std::min(slots.size(), kMaxAtOnce));
    ZoneTransaction transaction(StateForWriter(), now_ns_());
    {
      const WriterLock lock(data_mutex_);
      Commit(transaction, [&] { officials_.Distrust(vehicle, slots, why, transaction); });
    }
    FollowUp(transaction);
    withdrawn += slots.size();
    if (last) return withdrawn;
  }
}

bool ZoneService::UpdateVehicle(const VehicleState& told) {
  VehicleState vehicle = told;
  vehicle.heard_ns = now_ns_();
  const std::size_t max_bytes = config_.limits.max_text_bytes;
  const bool acceptable =
      IsPrintableText(vehicle.vehicle_id, max_bytes) &&
      (vehicle.drive_id.empty() || IsPrintableText(vehicle.drive_id, max_bytes)) &&
      geo::IsValid(vehicle.position) && !std::isinf(vehicle.course_rad) &&
      !std::isinf(vehicle.speed_mps) && vehicle.stamp_ns >= 0;
  if (!acceptable) {
    ++vehicle_positions_refused_;
    return false;
  }
  ++vehicle_positions_;
  vehicles_.Update(vehicle);
  polls_.SetVehicle(vehicle);
  ZoneEvent message;
  message.vehicle = std::move(vehicle);
  stream_.Publish(message);
  return true;
}

std::vector<VehicleState> ZoneService::Vehicles() const { return vehicles_.List(now_ns_()); }

std::vector<Hazard> ZoneService::Query(const std::optional<geo::GeoBox>& box,
                                       std::uint64_t since_sequence, std::size_t limit,
                                       const HazardStates& states) const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().hazards.Query(box, since_sequence, limit, states);
}

std::vector<Hazard> ZoneService::QueryNear(const geo::GeoPoint& centre, double radius_m,
                                           std::size_t limit) const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().hazards.QueryNear(centre, radius_m, limit);
}

std::vector<Hazard> ZoneService::ChangedAround(const geo::GeoPoint& centre, double radius_m,
                                               std::uint64_t since_sequence,
                                               std::size_t limit) const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().hazards.ChangedAround(centre, radius_m, since_sequence, limit);
}

std::optional<Hazard> ZoneService::Find(const Uuid& uuid) const {
  const ReaderLock lock(data_mutex_);
  const HazardRegistry& hazards = StateForReaders().hazards;
  const auto slot = hazards.Find(uuid);
  return slot ? std::optional<Hazard>(hazards.Get(*slot)) : std::nullopt;
}

std::vector<StoredEvent> ZoneService::Events(const Uuid& hazard, std::size_t limit) const {
  const MutexLock writer(writer_mutex_);
  const ZoneState& state = StateForWriter();
  const auto slot = state.hazards.Find(hazard);
  if (!slot) return {};
  return state.store.LoadEvents(hazard, state.hazards.Record(*slot).sequence, limit);
}

std::vector<MapChangeFeature> ZoneService::QueryMapChanges(const std::optional<geo::GeoBox>& box,
                                                           std::uint64_t since_sequence,
                                                           std::size_t limit,
                                                           const MapChangeStates& states) const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().map_changes.Query(box, since_sequence, limit, states);
}

std::optional<MapChangeFeature> ZoneService::FindMapChange(const Uuid& uuid) const {
  const ReaderLock lock(data_mutex_);
  const MapChangeFeature* feature = StateForReaders().map_changes.Find(uuid);
  return feature != nullptr ? std::optional<MapChangeFeature>(*feature) : std::nullopt;
}

std::vector<StoredMapChangeEvent> ZoneService::MapChangeEvents(const Uuid& uuid,
                                                               std::size_t limit) const {
  const MutexLock writer(writer_mutex_);
  const ZoneState& state = StateForWriter();
  const MapChangeFeature* feature = state.map_changes.Find(uuid);
  if (feature == nullptr) return {};
  return state.store.LoadMapChangeEvents(feature->sequence, limit);
}

std::optional<std::string> ZoneService::ImagePath(const std::string& sha256) const {
  return images_.Path(sha256);
}

int ZoneService::Subscribe(Subscriber subscriber) {
  return stream_.Subscribe(std::move(subscriber));
}

void ZoneService::Unsubscribe(int id) { stream_.Unsubscribe(id); }

std::uint64_t ZoneService::Sequence() const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().sequence;
}

std::uint64_t ZoneService::AnnouncedSequence() const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().announced;
}

ZoneStatistics ZoneService::Statistics() const {
  const ReaderLock lock(data_mutex_);
  const ZoneState& state = StateForReaders();
  ZoneStatistics statistics = statistics_;
  statistics.vehicle_positions = vehicle_positions_;
  statistics.vehicle_positions_refused = vehicle_positions_refused_;
  statistics.store_errors = store_errors_;
  statistics.active_hazards = state.hazards.on_map_count();
  statistics.hazards_by_state = state.hazards.counts();
  statistics.map_changes.by_state = state.map_changes.counts();
  statistics.image_bytes = images_.total_bytes();
  statistics.suspect_vehicles = state.trust.Count(config_.life.suspect_above, now_ns_());
  return statistics;
}

}  // namespace livemap::zone
