#include "zone/service/zone_service.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "common/clock.h"
#include "common/error.h"
#include "common/sqlite.h"
#include "common/time.h"
#include "protocol/text_rules.h"
#include "zone/model/hazard_spot.h"

namespace livemap::zone {
namespace {

/// Reports wait while a piece of a decision about a vehicle is looked for and committed.
constexpr std::size_t kMaxHazardsAtOnce = 500;
constexpr std::size_t kMaxLooksAtOnce = 100'000;
constexpr std::size_t kShownDecisions = 20;
/// So many decisions about a hazard are looked at for the newest request for a frame.
constexpr std::size_t kMaxDecisionsForFrame = 1000;
/// That are deleted for their age in one step.
constexpr std::size_t kMaxPicturesAtOnce = 100;
/// Of which vehicles the outboxes count: they tell their places about once a second.
constexpr double kOutboxAgesS = 60;
/// Longer than a commit takes on a busy machine.
constexpr std::int64_t kStorePatienceNs = 5'000'000'000;
/// Between two pieces: a lock that is taken again at once lets nobody in.
constexpr std::chrono::milliseconds kPause{2};

PlaceBook::Config PlaceRules(const ZoneConfig& config) {
  return {config.speed, config.limits, config.max_vehicles};
}

/// Never by the seed: a test that replays a run is another start, too.
Uuid NewLogId() {
  auto generator = EntropySeededGenerator();
  return Uuid::Random(generator);
}

}  // namespace

ZoneService::ZoneService(Config config, Clock now_ns, std::uint64_t uuid_seed)
    : config_(CheckedConfig(std::move(config))),
      now_ns_(std::move(now_ns)),
      log_id_(NewLogId()),
      directory_(config_.directory),
      state_(config_, directory_.path(), uuid_seed),
      images_(directory_.path() + "/images", static_cast<std::uint64_t>(config_.image_cap_bytes)),
      vehicles_(config_.vehicle_retention_s, config_.max_vehicles),
      places_(PlaceRules(config_), state_.store),
      allowance_(config_.allowance),
      pictures_(config_.pictures),
      steps_(config_, state_),
      trails_(config_, state_, vehicles_),
      reports_(config_, state_, steps_, images_, pictures_, allowance_, places_, vehicles_,
               trails_),
      map_changes_(config_, state_, places_),
      polls_(config_, state_, steps_, images_, pictures_, allowance_, vehicles_, places_),
      officials_(config_, state_, steps_),
      desk_(state_, steps_),
      ageing_(state_, steps_) {
  state_.damage += places_.Load();
  sequence_ = state_.sequence;
  announced_ = state_.announced;
  statistics_.store_damage = state_.damage;
  const std::int64_t now = now_ns_();
  for (Slot slot = 0; slot < state_.hazards.size(); ++slot) {
    const HazardRecord& record = state_.hazards.Record(slot);
    if (IsOnMap(record.life.state)) images_.Retain(record.picture.Sha256());
    Schedule(slot, now);
  }
  polls_.RestoreFrames(now);
}

ZoneService::~ZoneService() = default;

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
  const PlaceBook::Drafts drafts(places_);
  ReportIntake::Batch batch = reports_.Examine(reports, transaction.now_ns());
  {
    const WriterLock lock(data_mutex_);
    if (!batch.pending.empty()) {
      const std::int64_t begin_ns = SteadyNs();
      Commit(transaction, [&] {
        writer_mutex_.AssertHeld();
        reports_.Apply(batch, transaction);
      });
      commit_times_.Add(Seconds(SteadyNs() - begin_ns));
    }
    statistics_.Add(batch.counted);
  }
  NoteAges(batch, transaction.now_ns());
  reports_.Close(batch, transaction.now_ns());
  FollowUp(transaction);
  return batch.TakeReceipts();
}

/// Stamps of a drive that is played back say nothing of how long reports take.
void ZoneService::NoteAges(const ReportIntake::Batch& batch, std::int64_t now_ns) {
  if (config_.replay) return;
  for (const ReportIntake::PendingReport& pending : batch.pending) {
    const auto& receipt = batch.receipts[pending.index];
    if (!receipt || receipt->status != protocol::Receipt::Status::kCommitted) continue;
    report_ages_.Add(Seconds(now_ns - (*batch.reports)[pending.index].stamp_ns));
  }
}

std::vector<protocol::Receipt> ZoneService::HandleMapChanges(
    const std::vector<protocol::MapChangeReport>& reports) {
  const MutexLock writer(writer_mutex_);
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  const PlaceBook::Drafts drafts(places_);
  MapChangeIntake::Batch batch = map_changes_.Examine(reports, transaction.now_ns());
  {
    const WriterLock lock(data_mutex_);
    if (!batch.pending.empty()) {
      Commit(transaction, [&] {
        writer_mutex_.AssertHeld();
        map_changes_.Apply(batch, transaction);
      });
    }
    statistics_.map_changes.Add(batch.counted);
  }
  places_.Keep(transaction.now_ns());
  FollowUp(transaction);
  return batch.TakeReceipts();
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
  const PlaceBook::Drafts drafts(places_);
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
  {
    const MutexLock telling(telling_mutex_);
    for (VehicleState& vehicle : vehicles_.TakeUntold(now_ns_())) {
      PublishVehicle(std::move(vehicle));
    }
  }
  const MutexLock writer(writer_mutex_);
  LetHazardsAge();
  CompleteTrails();
  places_.SaveCounts();
  places_.ForgetOld(now_ns_());
  if (config_.picture_days > 0) {
    images_.RemoveOlder(now_ns_() - Nanoseconds(config_.picture_days * 86400), kMaxPicturesAtOnce);
  }
}

void ZoneService::CheckStore() {
  const MutexLock writer(writer_mutex_);
  ZoneStore& store = StateForWriter().store;
  AskStore([&] {
    if (store_well_) {
      store.Ping();
    } else {
      store.TryWrite();
    }
  });
}

bool ZoneService::IsStoreWell() const {
  const std::int64_t asked_ns = store_asked_ns_;
  return store_well_ && (asked_ns == 0 || SteadyNs() - asked_ns < kStorePatienceNs);
}

void ZoneService::LetHazardsAge() {
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

/// Drivers hear of it with what is told of the hazard next.
void ZoneService::CompleteTrails() {
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  const std::vector<TrailCollector::Pass> due = trails_.TakeDue(transaction.now_ns());
  if (due.empty()) return;
  const WriterLock lock(data_mutex_);
  Commit(transaction, [&] {
    writer_mutex_.AssertHeld();
    trails_.Complete(due, transaction);
  });
}

template <typename Decide>
std::optional<std::uint64_t> ZoneService::DecideHazard(const Decide& decide) {
  const MutexLock writer(writer_mutex_);
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  const std::optional<OfficialActions::HazardDecision> decision = decide(transaction.now_ns());
  if (!decision) return std::nullopt;
  if (decision->repeats != 0) return decision->repeats;
  std::uint64_t id = 0;
  {
    const WriterLock lock(data_mutex_);
    Commit(transaction, [&] { id = officials_.Apply(*decision, transaction); });
  }
  FollowUp(transaction);
  return id;
}

std::optional<std::uint64_t> ZoneService::Confirm(const Uuid& hazard, const std::string& official,
                                                  const std::string& reason,
                                                  const std::optional<SeenHazard>& seen) {
  const std::string why = officials_.CheckedReason(official, reason);
  return DecideHazard(
      [&](std::int64_t now_ns) { return officials_.Confirm(hazard, official, why, seen, now_ns); });
}

std::optional<std::uint64_t> ZoneService::Reject(const Uuid& hazard, const std::string& official,
                                                 const std::string& reason,
                                                 const std::optional<SeenHazard>& seen) {
  const std::string why = officials_.CheckedReason(official, reason);
  return DecideHazard(
      [&](std::int64_t now_ns) { return officials_.Reject(hazard, official, why, seen, now_ns); });
}

bool ZoneService::Verify(const Uuid& hazard, const std::string& why) {
  return DecideHazard([&](std::int64_t now_ns) { return officials_.Verify(hazard, why, now_ns); })
      .has_value();
}

std::optional<std::uint64_t> ZoneService::Close(const Uuid& hazard, const std::string& official,
                                                const std::string& reason,
                                                const std::optional<SeenHazard>& seen) {
  const std::string why = officials_.CheckedReason(official, reason);
  return DecideHazard(
      [&](std::int64_t now_ns) { return officials_.Close(hazard, official, why, seen, now_ns); });
}

template <typename Change>
std::uint64_t ZoneService::ChangeAtDesk(const Change& change) {
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  HazardDesk::Done done;
  {
    const WriterLock lock(data_mutex_);
    Commit(transaction, [&] { done = change(transaction); });
    desk_.Keep(done);
  }
  FollowUp(transaction);
  return done.decision;
}

std::optional<std::uint64_t> ZoneService::Act(const Uuid& hazard, const std::string& official,
                                              const DeskAction& action) {
  officials_.CheckedReason(official, "");
  const MutexLock writer(writer_mutex_);
  if (!desk_.Check(hazard, action)) return std::nullopt;
  const bool asks_for_frame = action.kind == DecisionKind::kAskFrame;
  const Slot slot = StateForWriter().hazards.Find(hazard).value_or(0);
  if (asks_for_frame) polls_.CheckFrame(slot, official, now_ns_());
  const std::uint64_t decision = ChangeAtDesk([&](ZoneTransaction& transaction) {
    writer_mutex_.AssertHeld();
    return desk_.Apply(hazard, official, action, transaction);
  });
  if (asks_for_frame) polls_.AskForFrame(decision, slot, official, now_ns_());
  return decision;
}

/// None where the undo means no decision of the desk.
std::optional<ZoneService::Undone> ZoneService::UndoAtDesk(const Uuid& hazard,
                                                           const std::string& official,
                                                           const std::string& why,
                                                           std::optional<std::uint64_t> meant) {
  const MutexLock writer(writer_mutex_);
  const auto decision = desk_.MeantBy(hazard, meant);
  if (!decision) return std::nullopt;
  if (decision->undone_by != 0) return Undone::kBefore;
  if (const auto why_not = desk_.WhyNotUndoable(*decision)) throw DecisionConflict(*why_not);
  if (decision->kind == DecisionKind::kAskFrame && !polls_.IsFrameOpen(decision->id, now_ns_())) {
    throw DecisionConflict("the request for a whole frame is over");
  }
  ChangeAtDesk([&](ZoneTransaction& transaction) {
    writer_mutex_.AssertHeld();
    return desk_.Undo(*decision, official, why, transaction);
  });
  polls_.CancelFrame(decision->id);
  return Undone::kDone;
}

bool ZoneService::Remove(const Uuid& hazard, const std::string& reason) {
  return DecideHazard(
             [&](std::int64_t now_ns) { return officials_.Remove(hazard, reason, now_ns); })
      .has_value();
}

std::optional<std::uint64_t> ZoneService::ConfirmMapChange(const Uuid& uuid,
                                                           const std::string& official,
                                                           const std::string& reason) {
  return DecideMapChange(uuid, MapChangeState::kConfirmed, official, reason);
}

std::optional<std::uint64_t> ZoneService::DismissMapChange(const Uuid& uuid,
                                                           const std::string& official,
                                                           const std::string& reason) {
  return DecideMapChange(uuid, MapChangeState::kDismissed, official, reason);
}

std::optional<std::uint64_t> ZoneService::DecideMapChange(const Uuid& uuid, MapChangeState to,
                                                          const std::string& official,
                                                          const std::string& reason) {
  const std::string why = officials_.CheckedReason(official, reason);
  const MutexLock writer(writer_mutex_);
  if (const auto before = officials_.RepeatOf(uuid, to, official, why)) return before;
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  std::uint64_t id = 0;
  {
    const WriterLock lock(data_mutex_);
    Commit(transaction,
           [&] { id = officials_.DecideMapChange(uuid, to, official, why, transaction); });
  }
  FollowUp(transaction);
  if (id == 0) return std::nullopt;
  return id;
}

ZoneService::Undone ZoneService::Undo(const Uuid& hazard, const std::string& official,
                                      const std::string& reason,
                                      std::optional<std::uint64_t> meant) {
  const std::string why = officials_.CheckedReason(official, reason);
  if (const auto at_desk = UndoAtDesk(hazard, official, why, meant)) return *at_desk;
  Undone undone = Undone::kUnknown;
  DecideHazard([&](std::int64_t now_ns) {
    return officials_.Undo(hazard, official, why, meant, now_ns, undone);
  });
  return undone;
}

ZoneService::Undone ZoneService::UndoMapChange(const Uuid& uuid, const std::string& official,
                                               const std::string& reason,
                                               std::optional<std::uint64_t> meant) {
  const std::string why = officials_.CheckedReason(official, reason);
  const MutexLock writer(writer_mutex_);
  Undone undone = Undone::kUnknown;
  const auto decision = officials_.UndoableOf(uuid, meant, undone);
  if (!decision) return undone;
  ZoneTransaction transaction(StateForWriter(), now_ns_());
  {
    const WriterLock lock(data_mutex_);
    Commit(transaction, [&] { officials_.UndoMapChange(*decision, official, why, transaction); });
  }
  FollowUp(transaction);
  return undone;
}

bool ZoneService::HasHeardOf(const std::string& vehicle_id) const {
  return !vehicles_.Track(vehicle_id).empty() || places_.HasHeardOf(vehicle_id);
}

std::optional<std::size_t> ZoneService::Distrust(const std::string& vehicle_id,
                                                 const std::string& official,
                                                 const std::string& reason) {
  const std::string why = officials_.CheckedReason(official, reason);
  if (!protocol::IsPrintableText(vehicle_id, config_.limits.max_text_bytes)) return std::nullopt;
  const std::uint64_t vehicle = VehicleKey(vehicle_id);
  const VehicleClaims::Claim claim(claims_, vehicle_id);
  OfficialActions::VehiclePiece piece;
  std::size_t withdrawn = 0;
  Slot next = 0;
  for (bool first = true;; std::this_thread::sleep_for(kPause)) {
    const MutexLock writer(writer_mutex_);
    ZoneState& state = StateForWriter();
    const std::vector<Slot> slots =
        state.hazards.HazardsWithEvidenceFrom(vehicle, next, kMaxHazardsAtOnce, kMaxLooksAtOnce);
    const bool last = next >= state.hazards.size();
    if (slots.empty() && !last) continue;
    if (first && slots.empty() && !HasHeardOf(vehicle_id)) return std::nullopt;
    if (first || !slots.empty()) {
      ZoneTransaction transaction(state, now_ns_());
      {
        const WriterLock lock(data_mutex_);
        Commit(transaction, [&] {
          piece =
              officials_.Distrust(vehicle_id, slots, official, why, piece.decision, transaction);
        });
      }
      FollowUp(transaction);
      withdrawn += piece.hazards;
      first = false;
    }
    if (last) return withdrawn;
  }
}

std::optional<std::size_t> ZoneService::Trust(const std::string& vehicle_id,
                                              const std::string& official,
                                              const std::string& reason) {
  const std::string why = officials_.CheckedReason(official, reason);
  if (!protocol::IsPrintableText(vehicle_id, config_.limits.max_text_bytes)) return std::nullopt;
  const VehicleClaims::Claim claim(claims_, vehicle_id);
  OfficialActions::VehiclePiece piece;
  for (std::size_t restored = 0;; std::this_thread::sleep_for(kPause)) {
    const MutexLock writer(writer_mutex_);
    if (!officials_.IsDistrusted(vehicle_id)) {
      if (piece.decision == 0 && !HasHeardOf(vehicle_id)) return std::nullopt;
      return restored;
    }
    ZoneTransaction transaction(StateForWriter(), now_ns_());
    {
      const WriterLock lock(data_mutex_);
      Commit(transaction, [&] {
        piece = officials_.Trust(vehicle_id, kMaxHazardsAtOnce, official, why, piece.decision,
                                 transaction);
      });
    }
    FollowUp(transaction);
    restored += piece.hazards;
    if (piece.is_last) return restored;
  }
}

std::optional<DistrustPreview> ZoneService::PreviewDistrust(const std::string& vehicle_id) const {
  if (!protocol::IsPrintableText(vehicle_id, config_.limits.max_text_bytes)) return std::nullopt;
  const std::uint64_t vehicle = VehicleKey(vehicle_id);
  DistrustPreview preview;
  for (Slot next = 0;; std::this_thread::sleep_for(kPause)) {
    const MutexLock writer(writer_mutex_);
    const ZoneState& state = StateForWriter();
    const std::vector<Slot> slots =
        state.hazards.HazardsWithEvidenceFrom(vehicle, next, kMaxHazardsAtOnce, kMaxLooksAtOnce);
    officials_.Preview(vehicle, slots, now_ns_(), preview);
    if (next < state.hazards.size()) continue;
    preview.is_distrusted = officials_.IsDistrusted(vehicle_id);
    preview.decisions = officials_.Decisions(vehicle_id, kShownDecisions);
    const bool is_known =
        preview.hazards > 0 || !preview.decisions.empty() || HasHeardOf(vehicle_id);
    return is_known ? std::optional(std::move(preview)) : std::nullopt;
  }
}

bool ZoneService::UpdateVehicle(const VehicleState& told) {
  VehicleState vehicle = told;
  vehicle.heard_ns = now_ns_();
  if (const auto why = places_.ChallengePosition(vehicle)) {
    ++positions_refused_[static_cast<std::size_t>(why->kind)];
    return false;
  }
  ++vehicle_positions_;
  polls_.SetVehicle(vehicle);
  const MutexLock telling(telling_mutex_);
  if (vehicles_.Update(vehicle)) PublishVehicle(std::move(vehicle));
  return true;
}

void ZoneService::PublishVehicle(VehicleState vehicle) {
  ZoneEvent message;
  message.vehicle = std::move(vehicle);
  stream_.Publish(message);
}

std::vector<VehicleState> ZoneService::Vehicles() const { return vehicles_.List(now_ns_()); }

std::vector<VehicleState> ZoneService::VehiclesAfter(const std::string& id,
                                                     std::size_t limit) const {
  return vehicles_.ListAfter(id, limit, now_ns_());
}

Page<Hazard> ZoneService::ReadHazards(const Walk<HazardState>& walk, std::size_t limit) const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().hazards.ReadPage(walk, limit);
}

std::array<std::size_t, kHazardStates> ZoneService::HazardCounts() const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().hazards.counts();
}

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

std::optional<geo::GeoBox> ZoneService::View() const {
  if (config_.limits.zone) return config_.limits.zone;
  return view_.Get([this] { return MakeView(); });
}

std::optional<geo::GeoBox> ZoneService::MakeView() const {
  // So many votes say where a crowd is; a lock is never held for longer than some of them take.
  constexpr std::size_t kMaxVotes = 100'000;
  constexpr std::size_t kLooks = 20'000;
  std::vector<ViewHazard> hazards;
  Slot next = 0;
  std::size_t on_map = 0;
  std::size_t step = 0;
  for (bool done = false; !done;) {
    const ReaderLock lock(data_mutex_);
    const HazardRegistry& registry = StateForReaders().hazards;
    if (step == 0) step = 1 + registry.on_map_count() / kMaxVotes;
    registry.AppendToView(next, on_map, step, kLooks, hazards);
    done = next >= registry.size();
  }
  return ViewOf(hazards);
}

std::optional<Hazard> ZoneService::Find(const Uuid& uuid) const {
  const ReaderLock lock(data_mutex_);
  const HazardRegistry& hazards = StateForReaders().hazards;
  const auto slot = hazards.Find(uuid);
  return slot ? std::optional<Hazard>(hazards.Get(*slot)) : std::nullopt;
}

std::vector<StoredEvent> ZoneService::Events(const Uuid& hazard, std::size_t limit) const {
  std::uint64_t sequence = 0;
  const ZoneStore* store = nullptr;
  {
    const ReaderLock lock(data_mutex_);
    const ZoneState& state = StateForReaders();
    const auto slot = state.hazards.Find(hazard);
    if (!slot) return {};
    sequence = state.hazards.Record(*slot).sequence;
    store = &state.store;
  }
  // Any thread may.
  return store->LoadEvents(hazard, sequence, limit);
}

std::vector<DecisionRecord> ZoneService::Decisions(std::uint64_t before, std::size_t limit) const {
  return HistoryStore().LoadAllDecisions(before, limit);
}

std::vector<DecisionRecord> ZoneService::DecisionsAfter(std::uint64_t id, std::size_t limit) const {
  return HistoryStore().LoadDecisionsAfter(id, limit);
}

std::vector<StoredEvent> ZoneService::TurnsAfter(std::uint64_t sequence, std::size_t limit) const {
  return HistoryStore().LoadTurnsAfter(sequence, limit);
}

/// For the functions of the store that any thread may call.
const ZoneStore& ZoneService::HistoryStore() const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().store;
}

std::vector<DecisionRecord> ZoneService::DecisionsAbout(const Uuid& hazard,
                                                        std::size_t limit) const {
  return HistoryStore().LoadDecisionsAbout(hazard.ToString(), limit);
}

std::vector<Assignment> ZoneService::Assignments() const {
  std::vector<Assignment> assignments = HistoryStore().LoadAssignments();
  const ReaderLock lock(data_mutex_);
  const HazardRegistry& hazards = StateForReaders().hazards;
  const auto is_off_map = [&](const Assignment& assignment) {
    const auto slot = hazards.Find(assignment.hazard);
    return !slot || !IsOnMap(hazards.State(*slot));
  };
  assignments.erase(std::remove_if(assignments.begin(), assignments.end(), is_off_map),
                    assignments.end());
  return assignments;
}

/// The hazard and those that were merged into it.
std::vector<Uuid> ZoneService::WithMerged(const Uuid& hazard, std::size_t limit) const {
  std::vector<Uuid> hazards{hazard};
  for (const DecisionRecord& decision : DecisionsAbout(hazard, limit)) {
    if (decision.kind != DecisionKind::kMergeHazard || decision.undone_by != 0) continue;
    const auto merged = Uuid::Parse(decision.before.substr(0, decision.before.find('|')));
    if (merged) hazards.push_back(*merged);
  }
  return hazards;
}

std::vector<AnswerPicture> ZoneService::AnswerPictures(const Uuid& hazard,
                                                       std::size_t limit) const {
  std::vector<AnswerPicture> pictures;
  for (const Uuid& each : WithMerged(hazard, limit)) {
    const ZoneStore* store = nullptr;
    std::uint64_t id = 0;
    {
      const ReaderLock lock(data_mutex_);
      const ZoneState& state = StateForReaders();
      const auto slot = state.hazards.Find(each);
      if (!slot) continue;
      store = &state.store;
      id = state.hazards.Record(*slot).id;
    }
    const std::vector<AnswerPicture> more = store->LoadAnswerPictures(id, limit);
    pictures.insert(pictures.end(), more.begin(), more.end());
  }
  std::stable_sort(pictures.begin(), pictures.end(),
                   [](const auto& a, const auto& b) { return a.stamp_ns > b.stamp_ns; });
  if (pictures.size() > limit) pictures.resize(limit);
  return pictures;
}

std::optional<FrameStatus> ZoneService::FrameOf(const Uuid& hazard) const {
  const std::vector<DecisionRecord> decisions = DecisionsAbout(hazard, kMaxDecisionsForFrame);
  const auto newest = std::find_if(decisions.begin(), decisions.end(), [](const auto& decision) {
    return decision.kind == DecisionKind::kAskFrame;
  });
  if (newest == decisions.end()) return std::nullopt;
  FrameStatus status;
  status.request = {newest->id, hazard, newest->official, newest->at_ns,
                    newest->at_ns + Nanoseconds(config_.frame_timeout_s)};
  for (AnswerPicture& picture : AnswerPictures(hazard, kMaxDecisionsForFrame)) {
    if (picture.decision == newest->id) status.picture = std::move(picture);
  }
  status.state = status.picture                        ? FrameState::kTaken
                 : newest->undone_by != 0              ? FrameState::kCancelled
                 : now_ns_() > status.request.until_ns ? FrameState::kTimedOut
                                                       : FrameState::kWaiting;
  return status;
}

std::vector<SightingRecord> ZoneService::Sightings(const Uuid& hazard, std::size_t limit) const {
  std::vector<SightingRecord> sightings;
  for (const Uuid& each : WithMerged(hazard, limit)) {
    const ZoneStore* store = nullptr;
    std::uint64_t id = 0;
    std::size_t most = 0;
    {
      const ReaderLock lock(data_mutex_);
      const ZoneState& state = StateForReaders();
      const auto slot = state.hazards.Find(each);
      if (!slot) continue;
      store = &state.store;
      id = state.hazards.Record(*slot).id;
      most = std::min<std::size_t>(limit, state.hazards.Record(*slot).estimate.sightings);
    }
    const std::vector<SightingRecord> more = store->LoadSightings(id, each, most);
    sightings.insert(sightings.end(), more.begin(), more.end());
  }
  std::stable_sort(sightings.begin(), sightings.end(),
                   [](const auto& a, const auto& b) { return a.stamp_ns > b.stamp_ns; });
  if (sightings.size() > limit) sightings.resize(limit);
  return sightings;
}

std::vector<MapChangeFeature> ZoneService::QueryMapChanges(const std::optional<geo::GeoBox>& box,
                                                           std::uint64_t since_sequence,
                                                           std::size_t limit,
                                                           const MapChangeStates& states) const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().map_changes.Query(box, since_sequence, limit, states);
}

Page<MapChangeFeature> ZoneService::ReadMapChanges(const Walk<MapChangeState>& walk,
                                                   std::size_t limit) const {
  const ReaderLock lock(data_mutex_);
  return StateForReaders().map_changes.ReadPage(walk, limit);
}

std::optional<MapChangeFeature> ZoneService::FindMapChange(const Uuid& uuid) const {
  const ReaderLock lock(data_mutex_);
  const MapChangeFeature* feature = StateForReaders().map_changes.Find(uuid);
  return feature != nullptr ? std::optional<MapChangeFeature>(*feature) : std::nullopt;
}

std::vector<StoredMapChangeEvent> ZoneService::MapChangeEvents(const Uuid& uuid,
                                                               std::size_t limit) const {
  std::uint64_t sequence = 0;
  const ZoneStore* store = nullptr;
  {
    const ReaderLock lock(data_mutex_);
    const ZoneState& state = StateForReaders();
    const MapChangeFeature* feature = state.map_changes.Find(uuid);
    if (feature == nullptr) return {};
    sequence = feature->sequence;
    store = &state.store;
  }
  return store->LoadMapChangeEvents(sequence, limit);
}

std::optional<std::string> ZoneService::ImagePath(const std::string& sha256) const {
  return images_.Path(sha256);
}

streets::StreetWords ZoneService::WordsOf(const Hazard& hazard) const {
  if (config_.streets) {
    return streets::DescribeSpot(*config_.streets, SpotOf(hazard), config_.addresses.get());
  }
  streets::StreetWords words;
  words.note = "the zone has no street file";
  return words;
}

int ZoneService::Subscribe(Subscriber subscriber) {
  return stream_.Subscribe(std::move(subscriber));
}

void ZoneService::Unsubscribe(int id) { stream_.Unsubscribe(id); }

ZoneStatistics ZoneService::Statistics() const {
  const ReaderLock lock(data_mutex_);
  const ZoneState& state = StateForReaders();
  ZoneStatistics statistics = statistics_;
  statistics.vehicle_positions = vehicle_positions_;
  for (std::size_t i = 0; i < kRefusalKinds; ++i) {
    statistics.positions_refused_by_kind[i] = positions_refused_[i];
    statistics.vehicle_positions_refused += positions_refused_[i];
  }
  statistics.store_errors = store_errors_;
  statistics.active_hazards = state.hazards.on_map_count();
  statistics.hazards_by_state = state.hazards.counts();
  statistics.map_changes.by_state = state.map_changes.counts();
  statistics.image_bytes = images_.total_bytes();
  statistics.pictures_refused = pictures_.refused();
  statistics.outbox_ages_s = vehicles_.OutboxAges(now_ns_(), kOutboxAgesS);
  statistics.suspect_vehicles = state.trust.Count(config_.life.suspect_above, now_ns_());
  return statistics;
}

}  // namespace livemap::zone
