// One step of a hazard's life, whatever causes it; and what officials and time do.
#include <algorithm>
#include <utility>

#include "zone/service/zone_service_state.h"

namespace livemap::zone {
namespace {

constexpr std::size_t kMaxReasonBytes = 200;

/// Cut between two characters, so that it stays valid UTF-8.
std::string Shortened(std::string text) {
  if (text.size() <= kMaxReasonBytes) return text;
  std::size_t end = kMaxReasonBytes;
  while (end > 0 && (static_cast<std::uint8_t>(text[end]) & 0xc0U) == 0x80U) --end;
  text.resize(end);
  return text;
}

}  // namespace

std::string CheckedReason(const std::string& official, const std::string& reason,
                          std::size_t max_name_bytes) {
  if (!IsPrintableText(official, max_name_bytes)) {
    throw Error("the official's name of " + std::to_string(official.size()) +
                " bytes is not accepted: it must be printable UTF-8 of 1 to " +
                std::to_string(max_name_bytes) + " bytes");
  }
  std::string why = Shortened(reason);
  if (!why.empty() && !IsPrintableText(why, kMaxReasonBytes)) {
    throw Error("the reason is not accepted: it must be printable UTF-8");
  }
  return why;
}

ClassModel ZoneService::Implementation::ClassOf(Slot slot) const {
  const std::string& name = registry_.ClassName(slot);
  return ClassModelOf(config_.catalogue.Get(name), survival_.Of(name));
}

ZoneService::Implementation::Before ZoneService::Implementation::BeforeOf(Slot slot) const {
  const HazardRecord& record = registry_.Record(slot);
  return {record.life.state, record.sequence, record.picture};
}

void ZoneService::Implementation::Learn(const std::string& class_name,
                                        const LifetimeObservation& lesson, Change& change) {
  if (!(lesson.stood_s >= 0) || (lesson.stood_s == 0 && !lesson.ended)) return;
  const auto known = survival_.learned().find(class_name);
  // The first time only: a failed transaction takes back all of them.
  change.learned_before.emplace(
      class_name, known == survival_.learned().end() ? LearnedLifetime{} : known->second);
  survival_.Learn(class_name, lesson);
}

Evidence ZoneService::Implementation::EvidenceOf(EvidenceKind kind, const std::string& vehicle_id,
                                                 std::int64_t stamp_ns, std::int64_t now_ns) const {
  Evidence evidence{kind, VehicleKey(vehicle_id), SeenNs(stamp_ns, now_ns)};
  evidence.hostile = trust_.Hostile(evidence.vehicle, now_ns);
  return evidence;
}

void ZoneService::Implementation::Judge(const LifecycleUpdate& step, Change& change) {
  for (const Verdict& verdict : step.verdicts) {
    // The first time only: a failed transaction takes back all of them.
    change.trust_before.emplace(verdict.vehicle, trust_.Get(verdict.vehicle));
    trust_.Judge(verdict, change.now_ns);
  }
}

std::optional<ZoneService::Implementation::Slot> ZoneService::Implementation::MatchNow(
    const protocol::Report& report, Change& change) {
  auto match = registry_.FindMatch(report.class_name, report.position);
  while (match && PassTime(*match, change) && registry_.State(*match) == HazardState::kGone) {
    match = registry_.FindMatch(report.class_name, report.position);
  }
  return match;
}

bool ZoneService::Implementation::PassTime(Slot slot, Change& change) {
  PresenceRecord life = registry_.Record(slot).life;
  const LifecycleUpdate step = life_.Advance(ClassOf(slot), change.now_ns, life);
  if (!step.transition) return false;
  Step(slot, life, step, step.transition->reason, BeforeOf(slot), change);
  return true;
}

void ZoneService::Implementation::Step(Slot slot, const PresenceRecord& life,
                                       const LifecycleUpdate& step, const std::string& reason,
                                       const Before& before, Change& change) {
  Learn(registry_.ClassName(slot), step.lesson, change);
  Judge(step, change);
  registry_.SetLife(slot, life, life_.Presence(ClassOf(slot), life, change.now_ns),
                    ++change.sequence, change.now_ns);
  RecordEvent(slot, before, reason, false, change);
}

void ZoneService::Implementation::RecordEvent(Slot slot, const std::optional<Before>& before,
                                              std::string reason, bool tells, Change& change) {
  const HazardState state = registry_.State(slot);
  const bool was_on_map = before && IsOnMap(before->state);
  HazardEvent event;
  event.action = !IsOnMap(state) ? HazardAction::kRemoved
                 : was_on_map    ? HazardAction::kUpdated
                                 : HazardAction::kAdded;
  if (before) event.from = before->state;
  event.reason = Shortened(std::move(reason));
  event.previous_announced = change.announced;
  const auto told = DriversAction(event.from, state);
  event.announced = told && (tells || *told != HazardAction::kUpdated);
  if (event.announced) {
    registry_.MarkAnnounced(slot);
    change.announced = change.sequence;
  }
  event.hazard = registry_.Get(slot);
  change.places.push_back({registry_.Record(slot).id, before ? before->sequence : 0});
  change.touched.push_back(slot);
  change.pictures.emplace_back(was_on_map ? before->picture.Sha256() : "",
                               IsOnMap(state) ? event.hazard.image_sha256 : "");
  change.events.push_back(std::move(event));
}

bool ZoneService::Implementation::Reject(const Uuid& uuid, const std::string& official,
                                         const std::string& reason) {
  const std::string why = CheckedReason(official, reason, config_.limits.max_text_bytes);
  return Decide(uuid, [&](Slot slot, PresenceRecord& life) {
    return life_.Reject(ClassOf(slot), official, why, now_ns_(), life);
  });
}

bool ZoneService::Implementation::Confirm(const Uuid& uuid, const std::string& official,
                                          const std::string& reason) {
  const std::string why = CheckedReason(official, reason, config_.limits.max_text_bytes);
  return Decide(uuid, [&](Slot slot, PresenceRecord& life) {
    return life_.Confirm(ClassOf(slot), official, why, now_ns_(), life);
  });
}

bool ZoneService::Implementation::Remove(const Uuid& uuid, const std::string& reason) {
  return Decide(uuid, [&](Slot, PresenceRecord& life) -> LifecycleUpdate {
    if (!IsOnMap(life.state)) return {};
    LifecycleUpdate step;
    step.transition = LifecycleTransition{life.state, HazardState::kGone, Shortened(reason)};
    life.state = HazardState::kGone;
    life.since_ns = now_ns_();
    return step;
  });
}

template <typename Decision>
bool ZoneService::Implementation::Decide(const Uuid& uuid, const Decision& decision) {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  Change change;
  {
    const std::unique_lock<std::shared_mutex> lock(data_mutex_);
    const auto slot = registry_.Find(uuid);
    if (!slot) return false;
    PresenceRecord life = registry_.Record(*slot).life;
    const LifecycleUpdate step = decision(*slot, life);
    if (!step.transition) return false;
    change = NewChange();
    InTransaction(
        change, [&] { Step(*slot, life, step, step.transition->reason, BeforeOf(*slot), change); });
  }
  Settle(change);
  return true;
}

bool ZoneService::Implementation::HasHeardOf(const std::string& vehicle_id) {
  return !vehicles_.Track(vehicle_id).empty() || tracks_.count(vehicle_id) != 0 ||
         store_.FindLastReport(vehicle_id).has_value();
}

std::optional<std::size_t> ZoneService::Implementation::Distrust(const std::string& vehicle_id,
                                                                 const std::string& official,
                                                                 const std::string& reason) {
  // Reports wait while a portion is committed.
  constexpr std::size_t kMaxAtOnce = 2000;
  const std::size_t max_bytes = config_.limits.max_text_bytes;
  const std::string given = CheckedReason(official, reason, max_bytes);
  if (!IsPrintableText(vehicle_id, max_bytes)) return std::nullopt;
  const std::string why = DecisionText("words of " + vehicle_id + " withdrawn", official, given);
  const std::uint64_t vehicle = VehicleKey(vehicle_id);
  std::size_t withdrawn = 0;
  for (bool first = true;; first = false) {
    const std::lock_guard<std::mutex> writer(writer_mutex_);
    std::vector<Slot> slots = registry_.HazardsWithEvidenceFrom(vehicle);
    if (first && slots.empty() && !HasHeardOf(vehicle_id)) return std::nullopt;
    const bool last = slots.size() <= kMaxAtOnce;
    slots.resize(std::min(slots.size(), kMaxAtOnce));
    Change change = NewChange();
    {
      const std::unique_lock<std::shared_mutex> lock(data_mutex_);
      InTransaction(change, [&] {
        change.trust_before.emplace(vehicle, trust_.Get(vehicle));
        trust_.Distrust(vehicle, change.now_ns);
        for (const Slot slot : slots) Withdraw(slot, vehicle, why, change);
      });
    }
    Settle(change);
    withdrawn += slots.size();
    if (last) return withdrawn;
  }
}

/// All that the vehicle said of the hazard.
void ZoneService::Implementation::Withdraw(Slot slot, std::uint64_t vehicle, const std::string& why,
                                           Change& change) {
  PresenceRecord life = registry_.Record(slot).life;
  const LifecycleUpdate step = life_.Withdraw(ClassOf(slot), vehicle, why, change.now_ns, life);
  if (step.transition) Step(slot, life, step, why, BeforeOf(slot), change);
}

void ZoneService::Implementation::Advance() {
  constexpr std::size_t kMaxAtOnce = 2000;
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  Change change = NewChange();
  const std::vector<Slot> due = due_.Take(change.now_ns, kMaxAtOnce);
  if (due.empty()) return;
  try {
    const std::unique_lock<std::shared_mutex> lock(data_mutex_);
    InTransaction(change, [&] {
      for (const Slot slot : due) PassTime(slot, change);
    });
  } catch (...) {
    for (const Slot slot : due) due_.Set(slot, change.now_ns);
    throw;
  }
  // A second at least: what is learned may put off what was due.
  for (const Slot slot : due) {
    const std::int64_t next_ns = life_.NextChangeNs(ClassOf(slot), registry_.Record(slot).life);
    due_.Set(slot, std::max(next_ns, change.now_ns + 1'000'000'000));
  }
  Settle(change);
}

std::vector<StoredEvent> ZoneService::Implementation::Events(const Uuid& uuid, std::size_t limit) {
  const std::lock_guard<std::mutex> writer(writer_mutex_);
  const auto slot = registry_.Find(uuid);
  if (!slot) return {};
  return store_.LoadEvents(uuid, registry_.Record(*slot).sequence, limit);
}

}  // namespace livemap::zone
