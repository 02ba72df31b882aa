#include "zone/service/zone_service.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "zone/service/zone_service_state.h"

namespace livemap::zone {
namespace {

void CheckSettings(const ZoneService::Config& config) {
  if (!(config.image_cap_bytes >= 0 && config.image_cap_bytes <= 1e15)) {
    throw Error("image_cap_bytes is " + std::to_string(config.image_cap_bytes) +
                ", accepted is 0 to 1e15");
  }
  if (!(config.vehicle_retention_s > 0 && config.vehicle_retention_s <= 1e6)) {
    throw Error("vehicle_retention_s is " + std::to_string(config.vehicle_retention_s) +
                ", accepted is above 0 to 1e6");
  }
  const SpeedRule& speed = config.speed;
  if (!(speed.max_speed_mps > 0 && speed.max_speed_mps <= 1e9 && speed.slack_m >= 0)) {
    throw Error("max_speed_mps is " + std::to_string(speed.max_speed_mps) + " and speed_slack_m " +
                std::to_string(speed.slack_m) + ", accepted are above 0 and at least 0");
  }
  if (speed.recovery_reports < 2) {
    throw Error("recovery_reports is " + std::to_string(speed.recovery_reports) +
                ", accepted is at least 2");
  }
  if (config.max_vehicles == 0) throw Error("max_vehicles is 0, accepted is at least 1");
}

/// What one vehicle tells of map changes is counted apart from its reports of hazards.
VehicleAllowance::Config MapChangeAllowance(const ZoneService::Config& config) {
  VehicleAllowance::Config allowance;
  allowance.reports_per_hour = config.map_changes_per_hour;
  allowance.max_vehicles = config.allowance.max_vehicles;
  return allowance;
}

}  // namespace

ZoneService::Implementation::Implementation(Config config, Clock now_ns, std::uint64_t uuid_seed)
    : config_(std::move(config)),
      now_ns_(std::move(now_ns)),
      directory_(config_.directory),
      life_(config_.life),
      store_(directory_.path() + "/zone.sqlite3"),
      survival_(config_.catalogue, config_.survival),
      trust_(config_.trust),
      allowance_(config_.allowance),
      map_change_allowance_(MapChangeAllowance(config_)),
      images_(directory_.path() + "/images", static_cast<std::uint64_t>(config_.image_cap_bytes)),
      vehicles_(config_.vehicle_retention_s, config_.max_vehicles),
      sequence_(store_.LastSequence()),
      generator_(MakeGenerator(uuid_seed, sequence_)),
      registry_(config_.catalogue, generator_()),
      map_changes_(config_.map_changes, generator_()),
      scheduler_(config_.polls, generator_()) {
  Load();
}

std::mt19937_64 ZoneService::Implementation::MakeGenerator(std::uint64_t seed,
                                                           std::uint64_t sequence) {
  std::seed_seq sequence_of_seeds{seed & 0xffffffffU, seed >> 32, sequence & 0xffffffffU,
                                  sequence >> 32};
  return std::mt19937_64(sequence_of_seeds);
}

void ZoneService::Implementation::Load() {
  StoreDamage& damage = statistics_.store_damage;
  damage += store_.LoadLives([this](const std::string& class_name, LearnedLifetime learned) {
    survival_.Restore(class_name, learned);
  });
  damage += store_.LoadTrust([this](std::uint64_t vehicle, const TrustRecord& record) {
    if (!trust_.Restore(vehicle, record)) throw Error("a vehicle's trust is no such record");
  });
  damage += store_.LoadHazards([this](const ZoneStore::HazardRow& row) {
    const Hazard& hazard = row.hazard;
    registry_.Restore(hazard, row.life, static_cast<std::uint32_t>(row.id));
    if (IsOnMap(hazard.state)) images_.Retain(hazard.image_sha256);
    announced_ = std::max(announced_, hazard.announced_sequence);
    sequence_ = std::max(sequence_, hazard.sequence);
  });
  registry_.SkipIdsTo(static_cast<std::uint32_t>(store_.LastHazardId()));
  damage += store_.LoadMapChanges([this](const ZoneStore::MapChangeRow& row) {
    map_changes_.Restore(static_cast<std::uint32_t>(row.id), row.feature);
    sequence_ = std::max(sequence_, row.feature.sequence);
  });
  map_changes_.SkipIdsTo(static_cast<std::uint32_t>(store_.LastMapChangeId()));
  const std::int64_t now_ns = now_ns_();
  for (Slot slot = 0; slot < registry_.size(); ++slot) Schedule(slot, now_ns);
}

ZoneService::Implementation::Change ZoneService::Implementation::NewChange() const {
  Change change;
  change.now_ns = now_ns_();
  change.sequence = sequence_;
  change.announced = announced_;
  return change;
}

/// Hazards and classes once, as they are in the end; hazards before what refers to them.
void ZoneService::Implementation::Write(Change& change) {
  std::vector<Slot>& touched = change.touched;
  std::sort(touched.begin(), touched.end());
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  for (const Slot slot : touched) {
    const HazardRecord& record = registry_.Record(slot);
    store_.WriteHazard({record.id, registry_.Get(slot), record.life});
  }
  for (std::size_t i = 0; i < change.events.size(); ++i) {
    const EventPlace& place = change.places[i];
    store_.WriteEvent(change.events[i], place.hazard_id, place.previous_sequence);
  }
  for (const AcceptedReport& accepted : change.reports) {
    store_.WriteReport(*accepted.report, accepted.hazard_id, accepted.image_sha256, change.now_ns);
  }
  if (change.answer != nullptr) {
    store_.WriteAnswer(*change.answer, change.answered_id, change.now_ns);
  }
  for (const auto& [class_name, before] : change.learned_before) {
    store_.WriteLife(class_name, survival_.learned().at(class_name));
  }
  for (const auto& [vehicle, before] : change.trust_before) {
    store_.WriteTrust(vehicle, trust_.Get(vehicle));
  }
  WriteMapChanges(change);
}

/// What a failed transaction taught.
void ZoneService::Implementation::Forget(const Change& change) {
  for (const auto& [class_name, before] : change.learned_before) {
    survival_.Restore(class_name, before);
  }
  for (const auto& [vehicle, before] : change.trust_before) trust_.Restore(vehicle, before);
}

void ZoneService::Implementation::Settle(const Change& change) {
  for (const auto& [before, after] : change.pictures) {
    images_.Retain(after);
    images_.Release(before);
  }
  images_.EvictBeyondCap();
  for (const Slot slot : change.touched) Schedule(slot, change.now_ns);
  for (const HazardEvent& event : change.events) {
    ZoneEvent message;
    message.hazard = event;
    stream_.Publish(message);
  }
  for (const MapChangeEvent& event : change.map_change_events) {
    ZoneEvent message;
    message.map_change = event;
    stream_.Publish(message);
  }
}

/// When time changes the hazard next, and when vehicles are to be asked about it.
void ZoneService::Implementation::Schedule(Slot slot, std::int64_t now_ns) {
  const HazardRecord& record = registry_.Record(slot);
  const ClassModel entry = ClassOf(slot);
  due_.Set(slot, life_.NextChangeNs(entry, record.life));
  const std::int64_t picture_ns = record.picture.empty() ? 0 : record.estimate.last_seen_ns;
  const std::lock_guard<std::mutex> lock(polls_mutex_);
  if (IsOnMap(record.life.state)) {
    scheduler_.SetHazard(slot, record.estimate.position, entry, record.life, picture_ns, now_ns);
  } else {
    scheduler_.RemoveHazard(slot);
  }
}

bool ZoneService::Implementation::UpdateVehicle(const VehicleState& told) {
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
  {
    const std::lock_guard<std::mutex> lock(polls_mutex_);
    scheduler_.SetVehicle(vehicle.vehicle_id, {vehicle.heard_ns, vehicle.position,
                                               vehicle.course_rad, vehicle.speed_mps});
  }
  ZoneEvent message;
  message.vehicle = std::move(vehicle);
  stream_.Publish(message);
  return true;
}

ZoneStatistics ZoneService::Implementation::Statistics() const {
  const std::shared_lock<std::shared_mutex> lock(data_mutex_);
  ZoneStatistics statistics = statistics_;
  statistics.vehicle_positions = vehicle_positions_;
  statistics.vehicle_positions_refused = vehicle_positions_refused_;
  statistics.store_errors = store_errors_;
  statistics.active_hazards = registry_.on_map_count();
  statistics.hazards_by_state = registry_.counts();
  statistics.map_changes.by_state = map_changes_.counts();
  statistics.image_bytes = images_.total_bytes();
  statistics.suspect_vehicles = trust_.Count(config_.life.suspect_above, now_ns_());
  return statistics;
}

ZoneService::ZoneService(Config config, Clock now_ns, std::uint64_t uuid_seed) {
  CheckSettings(config);
  config.trust.hostile_share = config.life.hostile_share;
  if (config.replay) config.limits.max_age_s = std::numeric_limits<double>::infinity();
  implementation_ =
      std::make_unique<Implementation>(std::move(config), std::move(now_ns), uuid_seed);
}

ZoneService::~ZoneService() = default;

protocol::Receipt ZoneService::Handle(const protocol::Report& report) {
  std::vector<protocol::Receipt> receipts = implementation_->HandleBatch({report});
  if (receipts.empty()) throw Error("too many reports of this vehicle within an hour");
  return std::move(receipts.front());
}

std::vector<protocol::Receipt> ZoneService::HandleBatch(
    const std::vector<protocol::Report>& reports) {
  return implementation_->HandleBatch(reports);
}

std::vector<Hazard> ZoneService::Query(const std::optional<geo::GeoBox>& box,
                                       std::uint64_t since_sequence, std::size_t limit,
                                       const HazardStates& states) const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->registry_.Query(box, since_sequence, limit, states);
}

std::vector<protocol::Receipt> ZoneService::HandleMapChanges(
    const std::vector<protocol::MapChangeReport>& reports) {
  return implementation_->HandleMapChanges(reports);
}

std::vector<MapChangeFeature> ZoneService::QueryMapChanges(const std::optional<geo::GeoBox>& box,
                                                           std::uint64_t since_sequence,
                                                           std::size_t limit,
                                                           const MapChangeStates& states) const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->map_changes_.Query(box, since_sequence, limit, states);
}

std::optional<MapChangeFeature> ZoneService::FindMapChange(const Uuid& uuid) const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  const MapChangeFeature* feature = implementation_->map_changes_.Find(uuid);
  return feature != nullptr ? std::optional<MapChangeFeature>(*feature) : std::nullopt;
}

std::vector<StoredMapChangeEvent> ZoneService::MapChangeEvents(const Uuid& uuid,
                                                               std::size_t limit) const {
  return implementation_->MapChangeEvents(uuid, limit);
}

bool ZoneService::ConfirmMapChange(const Uuid& uuid, const std::string& official,
                                   const std::string& reason) {
  return implementation_->DecideMapChange(uuid, MapChangeState::kConfirmed, official, reason);
}

bool ZoneService::DismissMapChange(const Uuid& uuid, const std::string& official,
                                   const std::string& reason) {
  return implementation_->DecideMapChange(uuid, MapChangeState::kDismissed, official, reason);
}

std::vector<Hazard> ZoneService::QueryNear(const geo::GeoPoint& centre, double radius_m,
                                           std::size_t limit) const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->registry_.QueryNear(centre, radius_m, limit);
}

std::optional<Hazard> ZoneService::Find(const Uuid& uuid) const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  const auto slot = implementation_->registry_.Find(uuid);
  return slot ? std::optional<Hazard>(implementation_->registry_.Get(*slot)) : std::nullopt;
}

std::vector<Hazard> ZoneService::ChangedAround(const geo::GeoPoint& centre, double radius_m,
                                               std::uint64_t since_sequence,
                                               std::size_t limit) const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->registry_.ChangedAround(centre, radius_m, since_sequence, limit);
}

std::vector<StoredEvent> ZoneService::Events(const Uuid& hazard, std::size_t limit) const {
  return implementation_->Events(hazard, limit);
}

bool ZoneService::Reject(const Uuid& hazard, const std::string& official,
                         const std::string& reason) {
  return implementation_->Reject(hazard, official, reason);
}

bool ZoneService::Confirm(const Uuid& hazard, const std::string& official,
                          const std::string& reason) {
  return implementation_->Confirm(hazard, official, reason);
}

std::optional<std::size_t> ZoneService::Distrust(const std::string& vehicle_id,
                                                 const std::string& official,
                                                 const std::string& reason) {
  return implementation_->Distrust(vehicle_id, official, reason);
}

bool ZoneService::Remove(const Uuid& hazard, const std::string& reason) {
  return implementation_->Remove(hazard, reason);
}

std::vector<protocol::Poll> ZoneService::TakeDuePolls() { return implementation_->TakeDuePolls(); }

bool ZoneService::HandleAnswer(const protocol::PollAnswer& answer) {
  return implementation_->HandleAnswer(answer);
}

void ZoneService::Advance() { implementation_->Advance(); }

std::optional<std::string> ZoneService::ImagePath(const std::string& sha256) const {
  return implementation_->images_.Path(sha256);
}

bool ZoneService::UpdateVehicle(const VehicleState& vehicle) {
  return implementation_->UpdateVehicle(vehicle);
}

std::vector<VehicleState> ZoneService::Vehicles() const {
  return implementation_->vehicles_.List(implementation_->now_ns_());
}

int ZoneService::Subscribe(Subscriber subscriber) {
  return implementation_->stream_.Subscribe(std::move(subscriber));
}

void ZoneService::Unsubscribe(int id) { implementation_->stream_.Unsubscribe(id); }

std::uint64_t ZoneService::Sequence() const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->sequence_;
}

std::uint64_t ZoneService::AnnouncedSequence() const {
  const std::shared_lock<std::shared_mutex> lock(implementation_->data_mutex_);
  return implementation_->announced_;
}

ZoneStatistics ZoneService::Statistics() const { return implementation_->Statistics(); }

}  // namespace livemap::zone
