#include "zone/service/official_actions.h"

#include <utility>

#include "common/error.h"
#include "common/text.h"
#include "zone/admission/report_validation.h"

namespace livemap::zone {

OfficialActions::OfficialActions(const ZoneConfig& config, ZoneState& state, HazardSteps& steps)
    : config_(config), state_(state), steps_(steps) {}

std::string OfficialActions::CheckedReason(const std::string& official,
                                           const std::string& reason) const {
  const std::size_t max_name_bytes = config_.limits.max_text_bytes;
  if (!IsPrintableText(official, max_name_bytes)) {
    throw Error("the official's name of " + std::to_string(official.size()) +
                " bytes is not accepted: it must be printable UTF-8 of 1 to " +
                std::to_string(max_name_bytes) + " bytes");
  }
  std::string why = CutUtf8(reason, kMaxEventReasonBytes);
  if (!why.empty() && !IsPrintableText(why, kMaxEventReasonBytes)) {
    throw Error("the reason is not accepted: it must be printable UTF-8");
  }
  return why;
}

std::optional<OfficialActions::HazardDecision> OfficialActions::Confirm(const Uuid& hazard,
                                                                        const std::string& official,
                                                                        const std::string& why,
                                                                        std::int64_t now_ns) const {
  const auto slot = state_.hazards.Find(hazard);
  if (!slot) return std::nullopt;
  HazardDecision decision{*slot, state_.hazards.Record(*slot).life, {}};
  decision.step =
      steps_.lifecycle().Confirm(steps_.ClassOf(*slot), official, why, now_ns, decision.life);
  return decision.step.transition ? std::optional(std::move(decision)) : std::nullopt;
}

std::optional<OfficialActions::HazardDecision> OfficialActions::Reject(const Uuid& hazard,
                                                                       const std::string& official,
                                                                       const std::string& why,
                                                                       std::int64_t now_ns) const {
  const auto slot = state_.hazards.Find(hazard);
  if (!slot) return std::nullopt;
  HazardDecision decision{*slot, state_.hazards.Record(*slot).life, {}};
  decision.step =
      steps_.lifecycle().Reject(steps_.ClassOf(*slot), official, why, now_ns, decision.life);
  return decision.step.transition ? std::optional(std::move(decision)) : std::nullopt;
}

std::optional<OfficialActions::HazardDecision> OfficialActions::Remove(const Uuid& hazard,
                                                                       const std::string& reason,
                                                                       std::int64_t now_ns) const {
  const auto slot = state_.hazards.Find(hazard);
  if (!slot || !IsOnMap(state_.hazards.State(*slot))) return std::nullopt;
  HazardDecision decision{*slot, state_.hazards.Record(*slot).life, {}};
  decision.step.transition = LifecycleTransition{decision.life.state, HazardState::kGone,
                                                 CutUtf8(reason, kMaxEventReasonBytes)};
  decision.life.state = HazardState::kGone;
  decision.life.since_ns = now_ns;
  return decision;
}

void OfficialActions::Apply(const HazardDecision& decision, ZoneTransaction& transaction) {
  steps_.KeepAsEvent(decision.slot, decision.life, decision.step, decision.step.transition->reason,
                     transaction.BeforeOf(decision.slot), transaction);
}

void OfficialActions::DecideMapChange(const Uuid& feature, MapChangeState to,
                                      const std::string& official, const std::string& why,
                                      ZoneTransaction& transaction) {
  const bool confirms = to == MapChangeState::kConfirmed;
  auto event = state_.map_changes.Decide(
      feature, to, DecisionText(confirms ? "confirmed" : "dismissed", official, why),
      {Uuid{}, transaction.sequence() + 1, transaction.now_ns()});
  if (event) transaction.RecordMapChangeEvent(*std::move(event));
}

void OfficialActions::Distrust(std::uint64_t vehicle, const std::vector<Slot>& slots,
                               const std::string& why, ZoneTransaction& transaction) {
  transaction.Distrust(vehicle);
  for (const Slot slot : slots) {
    PresenceRecord life = state_.hazards.Record(slot).life;
    const LifecycleUpdate step =
        steps_.lifecycle().Withdraw(steps_.ClassOf(slot), vehicle, why, transaction.now_ns(), life);
    if (!step.transition) continue;
    steps_.KeepAsEvent(slot, life, step, why, transaction.BeforeOf(slot), transaction);
  }
}

}  // namespace livemap::zone
