#include "zone/service/hazard_steps.h"

#include "streets/street_place.h"
#include "zone/model/hazard_spot.h"

namespace livemap::zone {

HazardSteps::HazardSteps(const ZoneConfig& config, ZoneState& state)
    : config_(config), state_(state), lifecycle_(config.life) {}

ClassModel HazardSteps::ClassOf(Slot slot) const {
  const std::string& name = state_.hazards.ClassName(slot);
  return ClassModelOf(config_.catalogue.Get(name), state_.survival.Of(name));
}

Evidence HazardSteps::EvidenceOf(EvidenceKind kind, const std::string& vehicle_id,
                                 std::int64_t stamp_ns, std::int64_t now_ns) const {
  Evidence evidence{kind, VehicleKey(vehicle_id), SeenNs(stamp_ns, now_ns)};
  evidence.malicious = state_.trust.MaliciousProbability(evidence.vehicle, now_ns);
  return evidence;
}

std::optional<HazardSteps::Slot> HazardSteps::MatchNow(const protocol::Report& report,
                                                       double course_rad,
                                                       ZoneTransaction& transaction) {
  auto match = FindMatch(report, course_rad);
  while (match && PassTime(*match, transaction) &&
         state_.hazards.State(*match) == HazardState::kGone) {
    match = FindMatch(report, course_rad);
  }
  return match;
}

std::optional<HazardSteps::Slot> HazardSteps::FindMatch(const protocol::Report& report,
                                                        double course_rad) const {
  const HazardRegistry& hazards = state_.hazards;
  const std::string class_name = hazards.HeadingOf(report.class_name);
  const streets::StreetMap* const map = config_.streets.get();
  const auto on = map == nullptr
                      ? std::nullopt
                      : streets::FindCarriageway(
                            *map, SpotOf(report.position, report.covariance_m2, course_rad));
  const auto may_match = [&](Slot slot) {
    if (!on) return true;
    const HazardRecord& record = hazards.Record(slot);
    const auto known = streets::FindCarriageway(
        *map, SpotOf(record.estimate.position, record.estimate.covariance_m2,
                     static_cast<double>(record.course_rad)));
    return !known || !streets::LieOnOppositeCarriageways(*map, *on, *known);
  };
  const auto match = on ? hazards.FindMatch(class_name, report.position, may_match)
                        : hazards.FindMatch(class_name, report.position);
  return match ? match : FindRedirected(class_name, report.position, may_match);
}

/// The hazard that an official has edited, and that the report would match as it was before.
std::optional<HazardSteps::Slot> HazardSteps::FindRedirected(
    const std::string& class_name, const geo::GeoPoint& position,
    const std::function<bool(Slot)>& may_match) const {
  if (state_.redirects.size() == 0) return std::nullopt;
  const auto hazard = state_.redirects.Find(
      class_name, position, config_.catalogue.DuplicateRadiusM(class_name), [&](const Uuid& uuid) {
        const auto slot = state_.hazards.Find(uuid);
        return slot && state_.hazards.State(*slot) != HazardState::kGone;
      });
  const auto slot = hazard ? state_.hazards.Find(*hazard) : std::nullopt;
  return slot && may_match(*slot) ? slot : std::nullopt;
}

bool HazardSteps::PassTime(Slot slot, ZoneTransaction& transaction) {
  PresenceRecord life = state_.hazards.Record(slot).life;
  const LifecycleUpdate step = lifecycle_.Advance(ClassOf(slot), transaction.now_ns(), life);
  if (!step.transition) return false;
  KeepAsEvent(slot, life, step, step.transition->reason, transaction.BeforeOf(slot), transaction);
  return true;
}

void HazardSteps::Keep(Slot slot, const PresenceRecord& life, const LifecycleUpdate& step,
                       ZoneTransaction& transaction) {
  const std::int64_t now_ns = transaction.now_ns();
  const ClassModel entry = ClassOf(slot);
  transaction.Learn(state_.hazards.ClassName(slot), step.lesson);
  transaction.Judge(step.verdicts);
  state_.hazards.SetLife(slot, life, lifecycle_.Presence(entry, life, now_ns),
                         transaction.sequence(), now_ns);
}

void HazardSteps::KeepAsEvent(Slot slot, const PresenceRecord& life, const LifecycleUpdate& step,
                              const std::string& reason, const ZoneTransaction::Before& before,
                              ZoneTransaction& transaction) {
  transaction.TakeSequence();
  Keep(slot, life, step, transaction);
  transaction.RecordHazardEvent(slot, before, reason, false);
}

}  // namespace livemap::zone
