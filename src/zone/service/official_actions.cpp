#include "zone/service/official_actions.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/error.h"
#include "common/number_text.h"
#include "common/text.h"
#include "protocol/text_rules.h"
#include "zone/belief/map_change_witnesses.h"

namespace livemap::zone {
namespace {

constexpr std::size_t kMaxExamples = 20;

/// State, denials and witnesses of a map change: what a decision changes of it.
std::string PackBefore(const MapChangeFeature& feature) {
  std::string line;
  AppendNumber(line, static_cast<int>(feature.state));
  AppendNumber(line, feature.denied_ns);
  return line + "|" + PackWitnesses(feature.witnesses);
}

std::optional<MapChangeFeature> UnpackBefore(const std::string& text) {
  const std::size_t bar = text.find('|');
  if (bar == std::string::npos) return std::nullopt;
  const std::string numbers = text.substr(0, bar);
  NumberReader reader(numbers);
  int state = -1;
  MapChangeFeature before;
  reader.Read(state);
  reader.Read(before.denied_ns);
  auto witnesses = UnpackWitnesses(text.substr(bar + 1));
  const bool is_state = state >= 0 && state < static_cast<int>(kMapChangeStates);
  if (!reader.good() || !reader.done() || !is_state || !witnesses) return std::nullopt;
  before.state = static_cast<MapChangeState>(state);
  before.witnesses = *std::move(witnesses);
  return before;
}

DecisionRecord MakeRecord(DecisionKind kind, std::string subject, const std::string& official,
                          const std::string& why, std::int64_t now_ns) {
  DecisionRecord record;
  record.kind = kind;
  record.subject = std::move(subject);
  record.official = official;
  record.reason = why;
  record.at_ns = now_ns;
  return record;
}

bool SameWords(const DecisionRecord& decision, DecisionKind kind, const std::string& official,
               const std::string& why) {
  return decision.kind == kind && decision.undone_by == 0 && decision.official == official &&
         decision.reason == why;
}

bool IsMeant(const DecisionRecord& decision, std::optional<std::uint64_t> meant) {
  return !meant || *meant == decision.id;
}

const VehicleEvidence* VoiceOf(std::uint64_t vehicle, const PresenceRecord& life) {
  const auto voice =
      std::find_if(life.voices.begin(), life.voices.end(),
                   [&](const VehicleEvidence& one) { return one.vehicle == vehicle; });
  return voice == life.voices.end() ? nullptr : &*voice;
}

}  // namespace

OfficialActions::OfficialActions(const ZoneConfig& config, ZoneState& state, HazardSteps& steps)
    : config_(config), state_(state), steps_(steps) {}

std::string OfficialActions::CheckedReason(const std::string& official,
                                           const std::string& reason) const {
  const std::size_t max_name_bytes = config_.limits.max_text_bytes;
  if (!protocol::IsAcceptableName(official, max_name_bytes)) {
    throw Error("the official's name of " + std::to_string(official.size()) +
                " bytes is not accepted: it must be printable UTF-8 of 1 to " +
                std::to_string(max_name_bytes) + " bytes");
  }
  std::string why = CutUtf8(reason, kMaxEventReasonBytes);
  if (!why.empty() && !protocol::IsAcceptableText(why, kMaxEventReasonBytes)) {
    throw Error("the reason is not accepted: it must be printable UTF-8 that is not all blanks");
  }
  return why;
}

std::vector<DecisionRecord> OfficialActions::Decisions(const std::string& subject,
                                                       std::size_t limit) const {
  return state_.store.LoadDecisions(subject, limit);
}

std::function<double(std::uint64_t)> OfficialActions::MaliciousOf(std::int64_t now_ns) const {
  return [this, now_ns](std::uint64_t vehicle) {
    return state_.trust.MaliciousProbability(vehicle, now_ns);
  };
}

/// Throws DecisionConflict when the hazard is in another state than it was then, or elsewhere.
void OfficialActions::RequireAsSeen(Slot slot, const SeenHazard& seen) const {
  constexpr std::size_t kMaxEvents = 1000;
  const HazardRecord& record = state_.hazards.Record(slot);
  if (record.sequence <= seen.sequence) return;
  const std::vector<StoredEvent> events =
      state_.store.LoadEvents(record.uuid, record.sequence, kMaxEvents);
  const auto next = std::find_if(events.begin(), events.end(), [&](const StoredEvent& event) {
    return event.sequence > seen.sequence;
  });
  if (next == events.end() || next == events.begin() || !next->from) {
    throw DecisionConflict("the hazard changed too often since it was seen; look at it again");
  }
  const HazardState state = record.life.state;
  if (*next->from != state) {
    throw DecisionConflict(std::string("the hazard changed since it was seen: it was ") +
                           HazardStateName(*next->from) + " and is " + HazardStateName(state) +
                           " now");
  }
  if (!seen.position) return;
  const double moved_m = geo::GeodesicDistanceM(*seen.position, record.estimate.position);
  if (moved_m <= config_.catalogue.DuplicateRadiusM(state_.hazards.ClassName(slot))) return;
  throw DecisionConflict("the hazard changed since it was seen: it lies " +
                         std::to_string(std::lround(moved_m)) + " m from where it was");
}

std::optional<OfficialActions::HazardDecision> OfficialActions::Decide(
    const Uuid& hazard, const std::string& official, const std::string& why,
    const std::optional<SeenHazard>& seen, std::int64_t now_ns, DecisionKind kind) const {
  const auto slot = state_.hazards.Find(hazard);
  if (!slot) return std::nullopt;
  const PresenceRecord& before = state_.hazards.Record(*slot).life;
  const ClassModel entry = steps_.ClassOf(*slot);
  HazardDecision decision{*slot, before, {}, std::nullopt, std::nullopt, 0};
  const bool confirms = kind == DecisionKind::kConfirmHazard;
  const bool is_confirmed =
      before.official && before.state == HazardState::kActive &&
      steps_.lifecycle().Presence(entry, before, now_ns) >= config_.life.settled_above;
  if (confirms ? is_confirmed : before.state == HazardState::kRejected) {
    const auto newest = state_.store.FindNewestDecision(hazard.ToString());
    if (newest && SameWords(*newest, kind, official, why)) {
      decision.repeats = newest->id;
      return decision;
    }
  }
  const LifecycleRule rule = confirms                             ? &HazardLifecycle::Confirm
                             : kind == DecisionKind::kCloseHazard ? &HazardLifecycle::Close
                                                                  : &HazardLifecycle::Reject;
  decision.step = (steps_.lifecycle().*rule)(entry, official, why, now_ns, decision.life);
  if (!decision.step.transition) return std::nullopt;
  if (seen) RequireAsSeen(*slot, *seen);
  decision.record = MakeRecord(kind, hazard.ToString(), official, why, now_ns);
  decision.record->before = PackPresence(before);
  return decision;
}

std::optional<OfficialActions::HazardDecision> OfficialActions::Confirm(
    const Uuid& hazard, const std::string& official, const std::string& why,
    const std::optional<SeenHazard>& seen, std::int64_t now_ns) const {
  return Decide(hazard, official, why, seen, now_ns, DecisionKind::kConfirmHazard);
}

std::optional<OfficialActions::HazardDecision> OfficialActions::Reject(
    const Uuid& hazard, const std::string& official, const std::string& why,
    const std::optional<SeenHazard>& seen, std::int64_t now_ns) const {
  return Decide(hazard, official, why, seen, now_ns, DecisionKind::kRejectHazard);
}

std::optional<OfficialActions::HazardDecision> OfficialActions::Close(
    const Uuid& hazard, const std::string& official, const std::string& why,
    const std::optional<SeenHazard>& seen, std::int64_t now_ns) const {
  return Decide(hazard, official, why, seen, now_ns, DecisionKind::kCloseHazard);
}

std::optional<OfficialActions::HazardDecision> OfficialActions::Undo(
    const Uuid& hazard, const std::string& official, const std::string& why,
    std::optional<std::uint64_t> meant, std::int64_t now_ns, Undone& undone) const {
  const auto slot = state_.hazards.Find(hazard);
  undone = slot ? Undone::kGone : Undone::kUnknown;
  if (!slot || state_.hazards.State(*slot) == HazardState::kGone) return std::nullopt;
  auto newest = state_.store.FindNewestDecision(hazard.ToString());
  const auto before = newest ? UnpackPresence(newest->before) : std::nullopt;
  undone = !before ? Undone::kNothing : IsMeant(*newest, meant) ? Undone::kBefore : Undone::kOther;
  if (undone != Undone::kBefore || newest->undone_by != 0) return std::nullopt;
  undone = Undone::kDone;
  HazardDecision decision{*slot, state_.hazards.Record(*slot).life, {}, {}, {}, 0};
  const std::string words =
      DecisionText(std::string(DecisionName(newest->kind)) + " undone", official, why);
  decision.step = steps_.lifecycle().Reinstate(steps_.ClassOf(*slot), *before, MaliciousOf(now_ns),
                                               WithdrawnSince(*before, decision.life, 0, now_ns),
                                               words, now_ns, decision.life);
  decision.record = MakeRecord(DecisionKind::kUndo, hazard.ToString(), official, why, now_ns);
  decision.undone = std::move(newest);
  return decision;
}

/// Vehicles whose words an official withdrew after `before`: undoing another decision must not
/// bring them back.
std::set<std::uint64_t> OfficialActions::WithdrawnSince(const PresenceRecord& before,
                                                        const PresenceRecord& life,
                                                        std::uint64_t trusted,
                                                        std::int64_t now_ns) const {
  std::set<std::uint64_t> withdrawn;
  for (const VehicleEvidence& voice : before.voices) {
    if (voice.vehicle == 0 || voice.vehicle == trusted) continue;
    if (VoiceOf(voice.vehicle, life) != nullptr || voice.suspect) continue;
    const double malicious = state_.trust.MaliciousProbability(voice.vehicle, now_ns);
    if (malicious >= config_.life.suspect_above) withdrawn.insert(voice.vehicle);
  }
  return withdrawn;
}

std::optional<OfficialActions::HazardDecision> OfficialActions::Remove(const Uuid& hazard,
                                                                       const std::string& reason,
                                                                       std::int64_t now_ns) const {
  const auto slot = state_.hazards.Find(hazard);
  if (!slot || !IsOnMap(state_.hazards.State(*slot))) return std::nullopt;
  HazardDecision decision{*slot, state_.hazards.Record(*slot).life, {}, {}, {}, 0};
  decision.step.transition = LifecycleTransition{decision.life.state, HazardState::kGone,
                                                 CutUtf8(reason, kMaxEventReasonBytes)};
  decision.life.state = HazardState::kGone;
  decision.life.since_ns = now_ns;
  return decision;
}

std::optional<OfficialActions::HazardDecision> OfficialActions::Verify(const Uuid& hazard,
                                                                       const std::string& why,
                                                                       std::int64_t now_ns) const {
  const auto slot = state_.hazards.Find(hazard);
  if (!slot) return std::nullopt;
  HazardDecision decision{*slot, state_.hazards.Record(*slot).life, {}, {}, {}, 0};
  decision.step = steps_.lifecycle().Doubt(steps_.ClassOf(*slot), why, now_ns, decision.life);
  if (!decision.step.transition) return std::nullopt;
  return decision;
}

std::uint64_t OfficialActions::Apply(const HazardDecision& decision, ZoneTransaction& transaction) {
  const std::int64_t now_ns = transaction.now_ns();
  std::map<std::uint64_t, double> suspicions;
  for (const Verdict& verdict : decision.step.verdicts) {
    suspicions[verdict.vehicle] = state_.trust.Suspicion(verdict.vehicle, now_ns);
  }
  steps_.KeepAsEvent(decision.slot, decision.life, decision.step, decision.step.transition->reason,
                     transaction.BeforeOf(decision.slot), transaction);
  if (!decision.record) return 0;
  DecisionRecord record = *decision.record;
  DecisionEffects effects;
  effects.stood_s = std::max(0.0, decision.step.lesson.stood_s);
  for (const auto& [vehicle, before] : suspicions) {
    const double added = state_.trust.Suspicion(vehicle, now_ns) - before;
    if (added != 0) effects.suspicions.push_back({vehicle, added});
  }
  record.effects = PackEffects(effects);
  const std::uint64_t id = state_.store.WriteDecision(record);
  if (!decision.undone) return id;
  state_.store.MarkDecisionUndone(decision.undone->id, id);
  const auto undone = UnpackEffects(decision.undone->effects);
  if (!undone) return id;
  for (const SuspicionChange& change : undone->suspicions) {
    transaction.TakeBackSuspicion(change, decision.undone->at_ns);
  }
  transaction.Unlearn(state_.hazards.ClassName(decision.slot), {undone->stood_s, false});
  return id;
}

std::optional<std::uint64_t> OfficialActions::RepeatOf(const Uuid& feature, MapChangeState to,
                                                       const std::string& official,
                                                       const std::string& why) const {
  const MapChangeFeature* known = state_.map_changes.Find(feature);
  if (known == nullptr || known->state != to) return std::nullopt;
  const bool confirms = to == MapChangeState::kConfirmed;
  // A further confirmation makes void what was told against it since.
  if (confirms && known->denied_ns != 0) return std::nullopt;
  const auto newest = state_.store.FindNewestDecision(feature.ToString());
  const DecisionKind kind =
      confirms ? DecisionKind::kConfirmMapChange : DecisionKind::kDismissMapChange;
  if (!newest || !SameWords(*newest, kind, official, why)) return std::nullopt;
  return newest->id;
}

std::uint64_t OfficialActions::DecideMapChange(const Uuid& feature, MapChangeState to,
                                               const std::string& official, const std::string& why,
                                               ZoneTransaction& transaction) {
  const MapChangeFeature* known = state_.map_changes.Find(feature);
  const std::string before = known != nullptr ? PackBefore(*known) : "";
  const bool confirms = to == MapChangeState::kConfirmed;
  auto event = state_.map_changes.Decide(
      feature, to, DecisionText(confirms ? "confirmed" : "dismissed", official, why),
      {Uuid{}, transaction.sequence() + 1, transaction.now_ns()});
  if (!event) return 0;
  transaction.RecordMapChangeEvent(*std::move(event));
  DecisionRecord record =
      MakeRecord(confirms ? DecisionKind::kConfirmMapChange : DecisionKind::kDismissMapChange,
                 feature.ToString(), official, why, transaction.now_ns());
  record.before = before;
  return state_.store.WriteDecision(record);
}

std::optional<DecisionRecord> OfficialActions::UndoableOf(const Uuid& feature,
                                                          std::optional<std::uint64_t> meant,
                                                          Undone& undone) const {
  const MapChangeFeature* known = state_.map_changes.Find(feature);
  undone = known != nullptr ? Undone::kGone : Undone::kUnknown;
  if (known == nullptr || known->state == MapChangeState::kUndone) return std::nullopt;
  auto newest = state_.store.FindNewestDecision(feature.ToString());
  const bool is_known = newest && UnpackBefore(newest->before);
  undone = !is_known                 ? Undone::kNothing
           : IsMeant(*newest, meant) ? Undone::kBefore
                                     : Undone::kOther;
  if (undone != Undone::kBefore || newest->undone_by != 0) return std::nullopt;
  undone = Undone::kDone;
  return newest;
}

void OfficialActions::UndoMapChange(const DecisionRecord& decision, const std::string& official,
                                    const std::string& why, ZoneTransaction& transaction) {
  const auto feature = Uuid::Parse(decision.subject);
  const auto before = UnpackBefore(decision.before);
  if (!feature || !before) return;
  auto event = state_.map_changes.TakeDecisionBack(
      *feature, *before,
      DecisionText(std::string(DecisionName(decision.kind)) + " undone", official, why),
      {Uuid{}, transaction.sequence() + 1, transaction.now_ns()});
  if (!event) return;
  transaction.RecordMapChangeEvent(*std::move(event));
  const std::uint64_t id = state_.store.WriteDecision(
      MakeRecord(DecisionKind::kUndo, decision.subject, official, why, transaction.now_ns()));
  state_.store.MarkDecisionUndone(decision.id, id);
}

bool OfficialActions::IsDistrusted(const std::string& vehicle_id) const {
  return state_.store.FindStandingDistrust(vehicle_id, UINT64_MAX).has_value();
}

OfficialActions::VehiclePiece OfficialActions::Distrust(
    const std::string& vehicle_id, const std::vector<Slot>& slots, const std::string& official,
    const std::string& why, std::uint64_t decision, ZoneTransaction& transaction) {
  const std::uint64_t vehicle = VehicleKey(vehicle_id);
  const std::string words = DecisionText("words of " + vehicle_id + " withdrawn", official, why);
  VehiclePiece piece;
  piece.decision = decision;
  if (decision != 0) {
    const auto standing = state_.store.FindStandingDistrust(vehicle_id, decision + 1);
    if (!standing || standing->id != decision) {
      throw DecisionConflict("the distrust was taken back before it was carried out");
    }
  }
  // The same again is no further decision, unless the vehicle has said more since.
  if (decision == 0 && (!slots.empty() || !IsDistrusted(vehicle_id))) {
    DecisionRecord record =
        MakeRecord(DecisionKind::kDistrustVehicle, vehicle_id, official, why, transaction.now_ns());
    record.before = PackTrust(state_.trust.Get(vehicle));
    piece.decision = state_.store.WriteDecision(record);
  }
  transaction.Distrust(vehicle);
  for (const Slot slot : slots) {
    const PresenceRecord before = state_.hazards.Record(slot).life;
    PresenceRecord life = before;
    const LifecycleUpdate step = steps_.lifecycle().Withdraw(steps_.ClassOf(slot), vehicle, words,
                                                             transaction.now_ns(), life);
    if (!step.transition) continue;
    steps_.KeepAsEvent(slot, life, step, words, transaction.BeforeOf(slot), transaction);
    state_.store.WriteWithdrawal(piece.decision,
                                 {state_.hazards.Record(slot).uuid, PackPresence(before)});
    ++piece.hazards;
  }
  if (piece.hazards > 0) state_.store.AddDecidedHazards(piece.decision, piece.hazards);
  return piece;
}

/// Gives a hazard back what a distrust took; false when nothing changes.
bool OfficialActions::Restore(const Withdrawal& withdrawal, std::uint64_t vehicle,
                              const std::string& why, ZoneTransaction& transaction) {
  const auto slot = state_.hazards.Find(withdrawal.hazard);
  const auto before = UnpackPresence(withdrawal.before);
  if (!slot || !before) return false;
  const std::int64_t now_ns = transaction.now_ns();
  const HazardRecord& record = state_.hazards.Record(*slot);
  PresenceRecord life = record.life;
  const ClassModel entry = steps_.ClassOf(*slot);
  // What was reported at its place since stands for it.
  const bool is_replaced =
      life.state == HazardState::kGone &&
      (state_.redirects.IsMergedAway(record.uuid) ||
       state_.hazards.FindMatch(state_.hazards.ClassName(*slot), record.estimate.position));
  if (is_replaced) return false;
  const bool was_decided =
      (life.state == HazardState::kRejected) != (before->state == HazardState::kRejected) ||
      life.official != before->official;
  LifecycleUpdate step;
  if (was_decided) {
    // An official has decided about the hazard since: that holds, and the word counts beside it.
    const VehicleEvidence* voice = VoiceOf(vehicle, *before);
    if (voice == nullptr) return false;
    Evidence word{voice->against ? EvidenceKind::kAnswerNo : EvidenceKind::kSighting, vehicle,
                  static_cast<std::int64_t>(voice->at_s) * 1'000'000'000};
    const HazardState from = life.state;
    step = steps_.lifecycle().Apply(entry, word, now_ns, life);
    if (!step.counted) return false;
    step.verdicts.clear();
    step.lesson = {};
    step.transition = LifecycleTransition{from, life.state, why};
  } else {
    step = steps_.lifecycle().Reinstate(entry, *before, MaliciousOf(now_ns),
                                        WithdrawnSince(*before, life, vehicle, now_ns), why, now_ns,
                                        life);
  }
  steps_.KeepAsEvent(*slot, life, step, why, transaction.BeforeOf(*slot), transaction);
  return true;
}

OfficialActions::VehiclePiece OfficialActions::Trust(const std::string& vehicle_id,
                                                     std::size_t max_hazards,
                                                     const std::string& official,
                                                     const std::string& why, std::uint64_t decision,
                                                     ZoneTransaction& transaction) {
  VehiclePiece piece;
  piece.decision = decision;
  const auto distrust = state_.store.FindStandingDistrust(vehicle_id, UINT64_MAX);
  piece.is_last = !distrust;
  if (!distrust) return piece;
  const std::uint64_t vehicle = VehicleKey(vehicle_id);
  if (piece.decision == 0) {
    piece.decision = state_.store.WriteDecision(
        MakeRecord(DecisionKind::kTrustVehicle, vehicle_id, official, why, transaction.now_ns()));
  }
  const std::string words = DecisionText("words of " + vehicle_id + " restored", official, why);
  const std::vector<Withdrawal> withdrawals =
      state_.store.LoadWithdrawals(distrust->id, max_hazards);
  for (const Withdrawal& withdrawal : withdrawals) {
    piece.hazards += Restore(withdrawal, vehicle, words, transaction) ? 1U : 0U;
    state_.store.DropWithdrawal(distrust->id, withdrawal.hazard);
  }
  if (piece.hazards > 0) state_.store.AddDecidedHazards(piece.decision, piece.hazards);
  if (withdrawals.size() == max_hazards) return piece;
  state_.store.MarkDecisionUndone(distrust->id, piece.decision);
  piece.is_last = !state_.store.FindStandingDistrust(vehicle_id, distrust->id);
  const auto trust = UnpackTrust(distrust->before);
  if (piece.is_last && trust) transaction.RestoreTrust(vehicle, *trust);
  return piece;
}

void OfficialActions::Preview(std::uint64_t vehicle, const std::vector<Slot>& slots,
                              std::int64_t now_ns, DistrustPreview& preview) const {
  std::vector<DistrustExample>& examples = preview.examples;
  for (const Slot slot : slots) {
    PresenceRecord life = state_.hazards.Record(slot).life;
    const LifecycleUpdate step =
        steps_.lifecycle().Withdraw(steps_.ClassOf(slot), vehicle, "", now_ns, life);
    if (!step.transition) continue;
    ++preview.hazards;
    const HazardState from = state_.hazards.State(slot);
    if (life.state == from) continue;
    ++preview.would_change;
    const bool vanishes = life.state == HazardState::kGone;
    // The first ones stay, but those that vanish go before those that do not.
    const auto place = vanishes ? examples.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                         preview.would_vanish, examples.size()))
                                : examples.end();
    preview.would_vanish += vanishes ? 1U : 0U;
    if (static_cast<std::size_t>(place - examples.begin()) >= kMaxExamples) continue;
    examples.insert(place,
                    {state_.hazards.Record(slot).uuid.ToString(), state_.hazards.ClassName(slot),
                     HazardStateName(from), HazardStateName(life.state)});
    if (examples.size() > kMaxExamples) examples.pop_back();
  }
}

}  // namespace livemap::zone
