#include "zone/service/hazard_desk.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/error.h"
#include "common/number_text.h"
#include "common/utc_text.h"
#include "protocol/text_rules.h"

namespace livemap::zone {
namespace {

/// So many decisions about one hazard are looked at for the one that an undo means.
constexpr std::size_t kMaxDecisionsPerHazard = 1000;
/// Where an official has put a hazard it lies to the metre.
constexpr double kPlacedVarianceM2 = 1;

std::string PackPlace(const HazardEstimate& estimate) {
  std::string line;
  AppendNumber(line, estimate.position.latitude_deg);
  AppendNumber(line, estimate.position.longitude_deg);
  AppendNumber(line, estimate.covariance_m2(0, 0));
  AppendNumber(line, estimate.covariance_m2(0, 1));
  AppendNumber(line, estimate.covariance_m2(1, 1));
  return line;
}

/// False, and nothing is changed, when `text` is nothing that PackPlace wrote.
bool UnpackPlace(const std::string& text, HazardEstimate& estimate) {
  NumberReader reader(text);
  geo::GeoPoint position;
  double east = 0, both = 0, north = 0;
  reader.Read(position.latitude_deg);
  reader.Read(position.longitude_deg);
  reader.Read(east);
  reader.Read(both);
  reader.Read(north);
  if (!reader.good() || !reader.done() || !geo::IsValid(position)) return false;
  estimate.position = position;
  estimate.covariance_m2 << east, both, both, north;
  return true;
}

std::string PackAssignment(const std::optional<Assignment>& assignment) {
  if (!assignment) return "";
  std::string line;
  AppendNumber(line, assignment->due_ns);
  AppendNumber(line, assignment->since_ns);
  AppendNumber(line, assignment->decision);
  return line + "|" + assignment->team;
}

std::optional<Assignment> UnpackAssignment(const std::string& text, const Uuid& hazard) {
  const std::size_t bar = text.find('|');
  if (bar == std::string::npos) return std::nullopt;
  const std::string numbers = text.substr(0, bar);
  NumberReader reader(numbers);
  Assignment assignment;
  assignment.hazard = hazard;
  assignment.team = text.substr(bar + 1);
  reader.Read(assignment.due_ns);
  reader.Read(assignment.since_ns);
  reader.Read(assignment.decision);
  if (!reader.good() || !reader.done()) return std::nullopt;
  return assignment;
}

/// The hazard that a merge took away, and its life of before.
std::optional<std::pair<Uuid, PresenceRecord>> UnpackMerged(const std::string& text) {
  const std::size_t bar = text.find('|');
  if (bar == std::string::npos) return std::nullopt;
  const auto hazard = Uuid::Parse(text.substr(0, bar));
  const auto life = UnpackPresence(text.substr(bar + 1));
  if (!hazard || !life) return std::nullopt;
  return std::pair(*hazard, *life);
}

std::string Metres(double distance_m) { return std::to_string(std::lround(distance_m)) + " m"; }

std::string DetailOf(const DeskAction& action) {
  if (action.team.empty()) return "to nobody";
  return "to " + action.team + (action.due_ns == 0 ? "" : ", due " + UtcDay(action.due_ns));
}

DecisionRecord MakeDeskRecord(const Uuid& hazard, const std::string& official,
                              const DeskAction& action, std::int64_t now_ns) {
  DecisionRecord record;
  record.kind = action.kind;
  record.subject = hazard.ToString();
  record.official = official;
  record.reason = action.text;
  record.at_ns = now_ns;
  return record;
}

void CheckDeskText(const DeskAction& action) {
  const bool may_be_empty = action.kind != DecisionKind::kComment;
  if (action.text.empty() && may_be_empty) return;
  const std::size_t most = may_be_empty ? kMaxEventReasonBytes : kMaxDecisionTextBytes;
  if (protocol::IsAcceptableText(action.text, most)) return;
  throw Error("the text of " + std::to_string(action.text.size()) +
              " bytes is not accepted: it must be printable UTF-8 of 1 to " + std::to_string(most) +
              " bytes that is not all blanks");
}

}  // namespace

HazardDesk::HazardDesk(ZoneState& state, HazardSteps& steps) : state_(state), steps_(steps) {}

HazardDesk::Slot HazardDesk::SlotOnMap(const Uuid& hazard, const char* which) const {
  const auto slot = state_.hazards.Find(hazard);
  if (slot && IsOnMap(state_.hazards.State(*slot))) return *slot;
  throw DecisionConflict(std::string(which) + " is not on the map any more");
}

bool HazardDesk::Check(const Uuid& hazard, const DeskAction& action) const {
  CheckDeskText(action);
  // Also of a hazard that is no longer known: who did it is kept all the same.
  if (IsOfOrder(action.kind)) {
    if (protocol::IsAcceptableText(action.order, kMaxOrderBytes)) return true;
    throw Error("the work order is not accepted: it must be printable UTF-8 of 1 to " +
                std::to_string(kMaxOrderBytes) + " bytes");
  }
  if (!state_.hazards.Find(hazard)) return false;
  if (action.kind == DecisionKind::kComment) return true;
  const Slot slot = SlotOnMap(hazard, "the hazard");
  const HazardRecord& record = state_.hazards.Record(slot);
  if (action.kind == DecisionKind::kAskFrame) return true;
  if (action.kind == DecisionKind::kAssign) {
    if (!action.team.empty() && !protocol::IsAcceptableName(action.team, kMaxTeamBytes)) {
      throw Error("the team is not accepted: it must be printable UTF-8 of 1 to " +
                  std::to_string(kMaxTeamBytes) + " bytes");
    }
  } else if (action.kind == DecisionKind::kReclassHazard) {
    const bool is_known = protocol::IsPrintableText(action.class_name, kMaxTeamBytes) &&
                          state_.hazards.HeadingOf(action.class_name) == action.class_name;
    if (!is_known) throw Error("the catalogue has no class '" + action.class_name + "'");
    if (action.class_name == state_.hazards.ClassName(slot)) {
      throw DecisionConflict("the hazard is of this class already");
    }
  } else if (action.kind == DecisionKind::kMoveHazard) {
    const double moved_m = geo::GeodesicDistanceM(record.estimate.position, action.position);
    if (moved_m > kMaxMoveM) {
      throw DecisionConflict("the new place is " + Metres(moved_m) +
                             " away, accepted are at most " + Metres(kMaxMoveM));
    }
  } else {
    CheckMerge(hazard, slot, action);
  }
  return true;
}

void HazardDesk::CheckMerge(const Uuid& hazard, Slot slot, const DeskAction& action) const {
  if (action.other == hazard) throw DecisionConflict("a hazard cannot be merged with itself");
  const Slot other = SlotOnMap(action.other, "the other hazard");
  const double apart_m = geo::GeodesicDistanceM(state_.hazards.Record(slot).estimate.position,
                                                state_.hazards.Record(other).estimate.position);
  if (apart_m <= kMaxMergeM) return;
  throw DecisionConflict("the other hazard is " + Metres(apart_m) + " away, accepted are at most " +
                         Metres(kMaxMergeM));
}

HazardDesk::Done HazardDesk::Apply(const Uuid& hazard, const std::string& official,
                                   const DeskAction& action, ZoneTransaction& transaction) {
  DecisionRecord record = MakeDeskRecord(hazard, official, action, transaction.now_ns());
  const bool leaves_hazard_alone = action.kind == DecisionKind::kComment ||
                                   action.kind == DecisionKind::kAskFrame || IsOfOrder(action.kind);
  if (leaves_hazard_alone) {
    record.detail = action.order;
    return {state_.store.WriteDecision(record), {}, 0};
  }
  if (action.kind == DecisionKind::kAssign) return Assign(std::move(record), hazard, action);
  const auto slot = state_.hazards.Find(hazard);
  if (!slot) return {};
  record.hazards = 1;
  if (action.kind == DecisionKind::kReclassHazard) {
    return Reclass(std::move(record), *slot, action, transaction);
  }
  if (action.kind == DecisionKind::kMoveHazard) {
    return Move(std::move(record), *slot, action, transaction);
  }
  return Merge(std::move(record), *slot, action, transaction);
}

std::optional<Assignment> HazardDesk::AssignmentOf(const Uuid& hazard) const {
  const std::vector<Assignment> all = state_.store.LoadAssignmentsForWriter();
  const auto one =
      std::find_if(all.begin(), all.end(), [&](const auto& each) { return each.hazard == hazard; });
  return one == all.end() ? std::nullopt : std::optional(*one);
}

HazardDesk::Done HazardDesk::Assign(DecisionRecord record, const Uuid& hazard,
                                    const DeskAction& action) {
  record.before = PackAssignment(AssignmentOf(hazard));
  record.detail = DetailOf(action);
  const std::uint64_t id = state_.store.WriteDecision(record);
  if (action.team.empty()) {
    state_.store.DropAssignment(hazard);
  } else {
    state_.store.WriteAssignment({hazard, action.team, action.due_ns, record.at_ns, id});
  }
  return {id, {}, 0};
}

/// The redirect's decision is filled in.
HazardDesk::Done HazardDesk::WriteEdit(const DecisionRecord& record, Redirect redirect) {
  redirect.kind = record.kind;
  redirect.decision = state_.store.WriteDecision(record);
  state_.store.WriteRedirect(redirect);
  return {redirect.decision, redirect, 0};
}

void HazardDesk::Edit(Slot slot, const std::string& class_name, const HazardEstimate& estimate,
                      const std::string& reason, ZoneTransaction& transaction) {
  const ZoneTransaction::Before before = transaction.BeforeOf(slot);
  const std::int64_t now_ns = transaction.now_ns();
  const std::uint64_t sequence = transaction.TakeSequence();
  const bool is_renamed = class_name != state_.hazards.ClassName(slot);
  state_.hazards.Edit(slot, class_name, estimate, sequence, now_ns);
  if (is_renamed) transaction.RenameHazard(slot);
  const PresenceRecord life = state_.hazards.Record(slot).life;
  const double presence = steps_.lifecycle().Presence(steps_.ClassOf(slot), life, now_ns);
  state_.hazards.SetLife(slot, life, presence, sequence, now_ns);
  transaction.RecordHazardEvent(slot, before, reason, true);
}

HazardDesk::Done HazardDesk::Reclass(DecisionRecord record, Slot slot, const DeskAction& action,
                                     ZoneTransaction& transaction) {
  const HazardRecord before = state_.hazards.Record(slot);
  record.before = state_.hazards.ClassName(slot);
  record.detail = "from " + record.before + " to " + action.class_name;
  Edit(slot, action.class_name, before.estimate,
       DecisionText("class changed " + record.detail, record.official, record.reason), transaction);
  return WriteEdit(
      record, {0, record.kind, record.before, before.estimate.position, before.uuid, before.uuid});
}

HazardDesk::Done HazardDesk::Move(DecisionRecord record, Slot slot, const DeskAction& action,
                                  ZoneTransaction& transaction) {
  const HazardRecord before = state_.hazards.Record(slot);
  const std::string class_name = state_.hazards.ClassName(slot);
  record.before = PackPlace(before.estimate);
  record.detail = "by " + Metres(geo::GeodesicDistanceM(before.estimate.position, action.position));
  HazardEstimate estimate = before.estimate;
  estimate.position = action.position;
  estimate.covariance_m2 = kPlacedVarianceM2 * Eigen::Matrix2d::Identity();
  Edit(slot, class_name, estimate,
       DecisionText("moved " + record.detail, record.official, record.reason), transaction);
  return WriteEdit(
      record, {0, record.kind, class_name, before.estimate.position, before.uuid, before.uuid});
}

HazardDesk::Done HazardDesk::Merge(DecisionRecord record, Slot slot, const DeskAction& action,
                                   ZoneTransaction& transaction) {
  const Slot other = SlotOnMap(action.other, "the other hazard");
  const HazardRecord gone = state_.hazards.Record(other);
  const std::string class_name = state_.hazards.ClassName(other);
  record.before = action.other.ToString() + "|" + PackPresence(gone.life);
  record.detail = "with a " + class_name + ' ' +
                  Metres(geo::GeodesicDistanceM(state_.hazards.Record(slot).estimate.position,
                                                gone.estimate.position)) +
                  " away";
  PresenceRecord life = gone.life;
  life.state = HazardState::kGone;
  life.since_ns = transaction.now_ns();
  const std::string away =
      DecisionText("merged into another hazard", record.official, record.reason);
  LifecycleUpdate step;
  step.transition = LifecycleTransition{gone.life.state, HazardState::kGone, away};
  steps_.KeepAsEvent(other, life, step, away, transaction.BeforeOf(other), transaction);
  HazardEstimate estimate = state_.hazards.Record(slot).estimate;
  estimate.sightings += gone.estimate.sightings;
  Edit(slot, state_.hazards.ClassName(slot), estimate,
       DecisionText("merged " + record.detail, record.official, record.reason), transaction);
  return WriteEdit(record, {0, record.kind, class_name, gone.estimate.position, gone.uuid,
                            state_.hazards.Record(slot).uuid});
}

std::optional<DecisionRecord> HazardDesk::MeantBy(const Uuid& hazard,
                                                  std::optional<std::uint64_t> meant) const {
  for (DecisionRecord& decision :
       state_.store.LoadDecisions(hazard.ToString(), kMaxDecisionsPerHazard)) {
    if (meant) {
      if (decision.id != *meant) continue;
      return IsOfDesk(decision.kind) ? std::optional(std::move(decision)) : std::nullopt;
    }
    const bool leaves_hazard_alone =
        decision.kind == DecisionKind::kComment || decision.kind == DecisionKind::kAssign ||
        decision.kind == DecisionKind::kAskFrame || IsOfOrder(decision.kind);
    if (leaves_hazard_alone || decision.kind == DecisionKind::kUndo) continue;
    return IsOfDesk(decision.kind) ? std::optional(std::move(decision)) : std::nullopt;
  }
  return std::nullopt;
}

std::optional<std::string> HazardDesk::WhyNotUndoable(const DecisionRecord& decision) const {
  if (IsOfOrder(decision.kind)) return "what was decided about a work order cannot be taken back";
  const auto hazard = Uuid::Parse(decision.subject);
  const auto slot = hazard ? state_.hazards.Find(*hazard) : std::nullopt;
  if (!slot) return "the hazard is not known any more";
  if (decision.kind == DecisionKind::kComment || decision.kind == DecisionKind::kAskFrame) {
    return std::nullopt;
  }
  if (state_.hazards.State(*slot) == HazardState::kGone) return "the hazard is gone";
  if (decision.kind == DecisionKind::kMergeHazard) {
    const auto merged = UnpackMerged(decision.before);
    const auto other = merged ? state_.hazards.Find(merged->first) : std::nullopt;
    if (!other) return "the hazard that was merged is not known any more";
    const HazardRecord& record = state_.hazards.Record(*other);
    const auto there =
        state_.hazards.FindMatch(state_.hazards.ClassName(*other), record.estimate.position);
    if (there && *there != *slot) return "another hazard was reported at its place since";
    return std::nullopt;
  }
  for (const DecisionRecord& later :
       state_.store.LoadDecisions(decision.subject, kMaxDecisionsPerHazard)) {
    if (later.id <= decision.id) break;
    if (later.kind == decision.kind && later.undone_by == 0) {
      return std::string("a later decision of this kind stands: ") + DecisionName(later.kind) +
             (later.detail.empty() ? "" : " " + later.detail);
    }
  }
  return std::nullopt;
}

HazardDesk::Done HazardDesk::Undo(const DecisionRecord& decision, const std::string& official,
                                  const std::string& why, ZoneTransaction& transaction) {
  TakeBack(decision,
           DecisionText(std::string(DecisionName(decision.kind)) + " undone", official, why),
           transaction);
  DecisionRecord record;
  record.kind = DecisionKind::kUndo;
  record.subject = decision.subject;
  record.official = official;
  record.reason = why;
  record.detail = std::string("of ") + DecisionName(decision.kind);
  record.at_ns = transaction.now_ns();
  const std::uint64_t id = state_.store.WriteDecision(record);
  state_.store.MarkDecisionUndone(decision.id, id);
  state_.store.DropRedirect(decision.id);
  return {id, {}, decision.id};
}

void HazardDesk::TakeBack(const DecisionRecord& decision, const std::string& reason,
                          ZoneTransaction& transaction) {
  const auto hazard = Uuid::Parse(decision.subject);
  const auto slot = hazard ? state_.hazards.Find(*hazard) : std::nullopt;
  if (!slot || decision.kind == DecisionKind::kComment) return;
  if (decision.kind == DecisionKind::kAskFrame) return;
  if (decision.kind == DecisionKind::kAssign) return TakeBackAssignment(decision, *hazard);
  if (decision.kind == DecisionKind::kMergeHazard) {
    return Split(decision, *slot, reason, transaction);
  }
  HazardEstimate estimate = state_.hazards.Record(*slot).estimate;
  std::string class_name = state_.hazards.ClassName(*slot);
  if (decision.kind == DecisionKind::kReclassHazard) {
    class_name = state_.hazards.HeadingOf(decision.before);
  } else if (!UnpackPlace(decision.before, estimate)) {
    throw DecisionConflict("where the hazard was before is not known any more");
  }
  Edit(*slot, class_name, estimate, reason, transaction);
}

void HazardDesk::TakeBackAssignment(const DecisionRecord& decision, const Uuid& hazard) {
  const auto before = UnpackAssignment(decision.before, hazard);
  if (before) {
    state_.store.WriteAssignment(*before);
  } else {
    state_.store.DropAssignment(hazard);
  }
}

void HazardDesk::Split(const DecisionRecord& decision, Slot slot, const std::string& reason,
                       ZoneTransaction& transaction) {
  const auto merged = UnpackMerged(decision.before);
  const auto other = merged ? state_.hazards.Find(merged->first) : std::nullopt;
  if (!other) throw DecisionConflict("the hazard that was merged is not known any more");
  PresenceRecord life = state_.hazards.Record(*other).life;
  const std::int64_t now_ns = transaction.now_ns();
  const auto malicious_of = [&](std::uint64_t vehicle) {
    return state_.trust.MaliciousProbability(vehicle, now_ns);
  };
  const LifecycleUpdate step = steps_.lifecycle().Reinstate(steps_.ClassOf(*other), merged->second,
                                                            malicious_of, {}, reason, now_ns, life);
  steps_.KeepAsEvent(*other, life, step, reason, transaction.BeforeOf(*other), transaction);
  HazardEstimate estimate = state_.hazards.Record(slot).estimate;
  const std::uint32_t theirs = state_.hazards.Record(*other).estimate.sightings;
  estimate.sightings = estimate.sightings > theirs ? estimate.sightings - theirs : 1;
  Edit(slot, state_.hazards.ClassName(slot), estimate, reason, transaction);
}

void HazardDesk::Keep(const Done& done) {
  if (done.dropped != 0) state_.redirects.Drop(done.dropped);
  if (done.added) state_.redirects.Add(*done.added);
}

}  // namespace livemap::zone
