#include "zone/belief/hazard_lifecycle.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "common/checks.h"
#include "common/log_odds.h"
#include "common/text.h"
#include "common/time.h"
#include "zone/model/hazard.h"

namespace livemap::zone {
namespace {

std::string LifecycleVehiclesText(std::uint32_t vehicles) {
  if (vehicles == 1) return "1 vehicle";
  return std::to_string(vehicles) + " vehicles";
}

std::string LifecyclePresenceText(double log_odds) {
  char text[40];
  std::snprintf(text, sizeof text, "presence %.0f %%", 100 * ProbabilityOf(log_odds));
  return text;
}

std::string LifecycleDurationText(double seconds) {
  struct Unit {
    double seconds;
    const char* name;
  };
  constexpr Unit kUnits[] = {{86400, "days"}, {3600, "h"}, {60, "min"}, {1, "s"}};
  const Unit* unit = kUnits;
  while (unit->seconds > 1 && seconds < 2 * unit->seconds) ++unit;
  char text[40];
  std::snprintf(text, sizeof text, "%.0f %s", seconds / unit->seconds, unit->name);
  return text;
}

double LifecycleAgeS(const PresenceRecord& life, std::int64_t at_ns) {
  return Seconds(std::max<std::int64_t>(0, at_ns - life.first_seen_ns));
}

double FadedLifecycle(const ClassModel& entry, double log_odds, const PresenceRecord& life,
                      double dt_s) {
  const double standing =
      ProbabilityOf(log_odds) * entry.survival.Survival(LifecycleAgeS(life, life.at_ns), dt_s);
  return LogOddsOf(standing);
}

LifecycleTransition LifecycleTransitionOf(const PresenceRecord& life, HazardState to,
                                          std::string reason) {
  return {life.state, to, CutUtf8(std::move(reason), kMaxEventReasonBytes)};
}

/// One hazard teaches of no more than so many lives of its class.
constexpr double kMaxLessonLives = 10;

/// However long a hazard stood, no single step of it teaches the class so much that it would live
/// otherwise from then on.
void BoundLifecycleLesson(const ClassModel& entry, LifecycleUpdate& step) {
  step.lesson.stood_s = std::min(step.lesson.stood_s, kMaxLessonLives * entry.survival.MeanLifeS());
}

void EnterLifecycleState(HazardState state, std::int64_t now_ns, PresenceRecord& life) {
  life.state = state;
  life.since_ns = now_ns;
}

}  // namespace

std::string DecisionText(const std::string& done, const std::string& official,
                         const std::string& reason) {
  return CutUtf8(done + " by " + official + (reason.empty() ? "" : ": " + reason),
                 kMaxEventReasonBytes);
}

HazardLifecycle::HazardLifecycle() : HazardLifecycle(Config()) {}

HazardLifecycle::HazardLifecycle(const Config& config)
    : config_(config),
      trust_update_({config.prior_presence, config.settled_above, config.suspect_above,
                     config.max_trust_step, config.official_weight}) {
  CheckRange("gone_below", config.gone_below, 0.01, 0.5);
  CheckRange("max_presence", config.max_presence, 0.9, 0.9999);
  CheckRange("prior_presence", config.prior_presence, 0.01, config.max_presence);
  CheckRange("verify_below", config.verify_below, config.gone_below, config.max_presence);
  CheckRange("settled_above", config.settled_above, config.verify_below, config.max_presence);
  CheckRange("active_above", config.active_above, config.gone_below, config.max_presence);
  CheckRange("active_alone_above", config.active_alone_above, config.gone_below,
             config.active_above);
  CheckRange("malicious_share", config.malicious_share, 0.001, 0.4);
  CheckRange("suspect_above", config.suspect_above, config.malicious_share + 0.001, 1);
  CheckRange("max_trust_step", config.max_trust_step, 0, 10);
  CheckRange("official_weight", config.official_weight, 0, 10);
  CheckRange("denying_vehicles", config.denying_vehicles, 2, kMaxEvidencePerHazard - 1);
  CheckRange("quarantine_s", config.quarantine_s, 0, 1e9);
  CheckRange("reopen_vehicles", config.reopen_vehicles, 2, kMaxEvidencePerHazard);
  CheckRange("rejected_keep_s", config.rejected_keep_s, 3600, 1e9);
  max_log_odds_ = LogOddsOf(config.max_presence);
  max_evidence_ = -LogOddsOf(config.malicious_share);
}

void HazardLifecycle::MoveTo(const ClassModel& entry, std::int64_t to_ns,
                             PresenceRecord& life) const {
  if (to_ns <= life.at_ns) return;
  if (life.state != HazardState::kRejected) {
    const double dt_s = Seconds(to_ns - life.at_ns);
    const auto fade = [&](double log_odds) {
      return std::max(-max_log_odds_, FadedLifecycle(entry, log_odds, life, dt_s));
    };
    life.log_odds = fade(life.log_odds);
    life.undenied_log_odds = fade(life.undenied_log_odds);
  }
  life.at_ns = to_ns;
}

double HazardLifecycle::LogRatio(const ClassModel& entry, const Evidence& evidence,
                                 double ended_since) const {
  const bool against = evidence.kind == EvidenceKind::kAnswerNo;
  // P(this word | there) and P(it | not there), of honest vehicles.
  const double there = against ? 1 - entry.hit_rate : entry.hit_rate;
  double absent = against ? 1 - entry.false_rate : entry.false_rate;
  // What is not there now may have been there then.
  absent = ended_since * there + (1 - ended_since) * absent;
  const double h = std::clamp(evidence.malicious, config_.malicious_share, 1.0);
  const double ratio = std::log(((1 - h) * there + h) / ((1 - h) * absent + h));
  const double bound = MaxLogOddsPerVehicle(evidence);
  return std::clamp(ratio, -bound, bound);
}

/// Half malicious is worth nothing; who is more so must not be believed the other way round.
double HazardLifecycle::MaxLogOddsPerVehicle(const Evidence& evidence) const {
  if (!(evidence.malicious > config_.malicious_share)) return max_evidence_;
  return std::max(0.0, -LogOddsOf(std::min(evidence.malicious, 0.5)));
}

bool HazardLifecycle::ApplyEvidence(const ClassModel& entry, const Evidence& evidence,
                                    PresenceRecord& life) const {
  const double late_s = Seconds(std::max<std::int64_t>(0, life.at_ns - evidence.stamp_ns));
  const double stood_since =
      entry.survival.Survival(LifecycleAgeS(life, evidence.stamp_ns), late_s);
  // What was seen that long ago and not since would be off the map by now.
  if (stood_since < config_.gone_below) return false;
  const bool against = evidence.kind == EvidenceKind::kAnswerNo;
  const auto at_s = static_cast<std::uint32_t>(std::max(0.0, Seconds(evidence.stamp_ns)));
  const bool suspect = evidence.malicious >= config_.suspect_above;
  VehicleEvidence* voice = PlaceForEvidence(evidence.vehicle, suspect, at_s, life);
  if (voice == nullptr || (voice->at_s == at_s && voice->against == against)) return false;
  const double ratio = LogRatio(entry, evidence, 1 - stood_since);

  // What the vehicle said for the hazard earlier has faded with the odds.
  double before = 1e-3 * voice->weight_1000;
  if (before > 0 && at_s > voice->at_s) {
    before *= std::exp(-static_cast<double>(at_s - voice->at_s) / entry.survival.MeanLifeS());
  }
  // The nearer a voice is to its bound, the less a further word adds; factors commute.
  const double bound = MaxLogOddsPerVehicle(evidence);
  const double room = ratio > 0 ? bound - before : bound + before;
  double after = before + ratio * (bound > 0 ? std::clamp(room / bound, 0.0, 1.0) : 0.0);
  // What the odds' own bound cuts off was not said: it must not be taken back later.
  const double odds = std::clamp(life.log_odds + after - before, -max_log_odds_, max_log_odds_);
  after = before + odds - life.log_odds;
  life.log_odds = odds;
  const double gain = std::max(0.0, after) - std::max(0.0, before);
  life.undenied_log_odds = std::min(max_log_odds_, life.undenied_log_odds + std::max(0.0, gain));

  voice->weight_1000 = static_cast<std::int16_t>(std::lround(1000 * after));
  if (at_s >= voice->at_s) {
    voice->at_s = at_s;
    voice->against = against;
    voice->suspect = suspect;
    life.SetJudged(static_cast<std::size_t>(voice - life.voices.data()), false);
  }
  if (suspect) return true;
  against ? RecordDenial(evidence.stamp_ns, life) : RecordSupport(evidence.stamp_ns, life);
  return true;
}

LifecycleUpdate HazardLifecycle::Begin(const ClassModel& entry, const Evidence& sighting,
                                       std::int64_t now_ns, PresenceRecord& life) const {
  life = PresenceRecord();
  life.since_ns = now_ns;
  life.at_ns = std::min(sighting.stamp_ns, now_ns);
  life.first_seen_ns = life.last_yes_ns = life.at_ns;
  life.log_odds = life.undenied_log_odds = LogOddsOf(config_.prior_presence);
  LifecycleUpdate step = Apply(entry, sighting, now_ns, life);
  if (!step.transition) {
    step.transition = LifecycleTransition{std::nullopt, life.state, "first seen by 1 vehicle"};
  }
  step.transition->from.reset();
  return step;
}

LifecycleUpdate HazardLifecycle::Apply(const ClassModel& entry, const Evidence& evidence,
                                       std::int64_t now_ns, PresenceRecord& life) const {
  LifecycleUpdate step;
  if (life.state == HazardState::kGone || evidence.kind == EvidenceKind::kCantSee ||
      evidence.vehicle == 0) {
    return step;
  }
  Evidence word = evidence;
  word.stamp_ns = std::min(word.stamp_ns, now_ns);
  const bool quarantined = life.state == HazardState::kRejected &&
                           Seconds(word.stamp_ns - life.since_ns) < config_.quarantine_s;
  if (quarantined) return step;
  const bool told = IsTold(life.state);
  const std::int64_t stood_until_ns = life.last_yes_ns;
  MoveTo(entry, word.stamp_ns, life);
  step.counted = ApplyEvidence(entry, word, life);
  if (step.counted && word.kind != EvidenceKind::kAnswerNo) {
    step.verdicts = trust_update_.AfterSighting(entry, word, life);
  }
  Settle(entry, now_ns, life, step);
  if (told) step.lesson.stood_s += Seconds(life.last_yes_ns - stood_until_ns);
  BoundLifecycleLesson(entry, step);
  return step;
}

LifecycleUpdate HazardLifecycle::Advance(const ClassModel& entry, std::int64_t now_ns,
                                         PresenceRecord& life) const {
  LifecycleUpdate step;
  if (life.state != HazardState::kGone) Settle(entry, now_ns, life, step);
  BoundLifecycleLesson(entry, step);
  return step;
}

void HazardLifecycle::Settle(const ClassModel& entry, std::int64_t now_ns, PresenceRecord& life,
                             LifecycleUpdate& step) const {
  MoveTo(entry, now_ns, life);
  step.transition = Decide(entry, life);
  if (!step.transition) return;
  if (life.state != HazardState::kRejected && IsDeniedAway(life)) {
    const std::vector<Verdict> verdicts = trust_update_.AfterDenial(entry, life);
    step.verdicts.insert(step.verdicts.end(), verdicts.begin(), verdicts.end());
  }
  const HazardState from = life.state;
  const HazardState to = step.transition->to;
  EnterLifecycleState(to, now_ns, life);
  if (from == HazardState::kCandidate && to == HazardState::kActive) {
    step.lesson.stood_s = Seconds(life.last_yes_ns - life.first_seen_ns);
  }
  // It ended somewhere between the last word for it and the first against it; without such a word
  // it was only lost from sight.
  if (IsTold(from) && to == HazardState::kGone && life.first_no_ns > life.last_yes_ns) {
    step.lesson.stood_s = 0.5 * Seconds(life.first_no_ns - life.last_yes_ns);
    step.lesson.ended = true;
  }
}

LifecycleUpdate HazardLifecycle::Confirm(const ClassModel& entry, const std::string& official,
                                         const std::string& reason, std::int64_t now_ns,
                                         PresenceRecord& life) const {
  LifecycleUpdate step;
  if (life.state == HazardState::kGone) return step;
  const bool told = IsTold(life.state);
  MoveTo(entry, now_ns, life);
  const std::int64_t stood_until_ns = told ? life.last_yes_ns : life.first_seen_ns;
  step.verdicts = trust_update_.AfterDecision(entry, true, life);
  for (VehicleEvidence& voice : life.voices) {
    if (voice.against) voice = VehicleEvidence();
  }
  RecordSupport(now_ns, life);
  life.official = true;
  life.log_odds = life.undenied_log_odds = max_log_odds_;
  step.counted = true;
  step.lesson.stood_s = Seconds(life.last_yes_ns - stood_until_ns);
  BoundLifecycleLesson(entry, step);
  // Confirmed again it stays what it is; that somebody looked is an event all the same.
  step.transition = LifecycleTransitionOf(life, HazardState::kActive,
                                          DecisionText("confirmed", official, reason));
  if (life.state != HazardState::kActive) EnterLifecycleState(HazardState::kActive, now_ns, life);
  return step;
}

LifecycleUpdate HazardLifecycle::Reject(const ClassModel& entry, const std::string& official,
                                        const std::string& reason, std::int64_t now_ns,
                                        PresenceRecord& life) const {
  LifecycleUpdate step;
  if (!IsOnMap(life.state)) return step;
  step.verdicts = trust_update_.AfterDecision(entry, false, life);
  step.transition = LifecycleTransitionOf(life, HazardState::kRejected,
                                          DecisionText("rejected", official, reason));
  EnterLifecycleState(HazardState::kRejected, now_ns, life);
  // From here on it must be shown anew that there is something.
  life.official = false;
  life.voices = {};
  life.judged = 0;
  life.first_no_ns = 0;
  life.at_ns = std::max(life.at_ns, now_ns);
  life.log_odds = life.undenied_log_odds = LogOddsOf(config_.prior_presence);
  return step;
}

LifecycleUpdate HazardLifecycle::Doubt(const ClassModel& entry, const std::string& why,
                                       std::int64_t now_ns, PresenceRecord& life) const {
  LifecycleUpdate step;
  if (!IsTold(life.state)) return step;
  MoveTo(entry, now_ns, life);
  const double presence = std::max(std::min(0.5, VerifyBelow(entry)), config_.gone_below);
  life.log_odds = std::min(life.log_odds, LogOddsOf(presence));
  life.official = false;
  step.transition = LifecycleTransitionOf(life, HazardState::kVerifying, why);
  if (life.state != HazardState::kVerifying) {
    EnterLifecycleState(HazardState::kVerifying, now_ns, life);
  }
  return step;
}

LifecycleUpdate HazardLifecycle::Close(const ClassModel& entry, const std::string& official,
                                       const std::string& reason, std::int64_t now_ns,
                                       PresenceRecord& life) const {
  LifecycleUpdate step = Reject(entry, official, reason, now_ns, life);
  step.verdicts.clear();
  if (step.transition) step.transition->reason = DecisionText("repaired", official, reason);
  return step;
}

LifecycleUpdate HazardLifecycle::Withdraw(const ClassModel& entry, std::uint64_t vehicle,
                                          const std::string& why, std::int64_t now_ns,
                                          PresenceRecord& life) const {
  LifecycleUpdate step;
  const auto voice =
      std::find_if(life.voices.begin(), life.voices.end(),
                   [&](const VehicleEvidence& one) { return one.vehicle == vehicle; });
  if (vehicle == 0 || life.state == HazardState::kGone || voice == life.voices.end()) return step;
  MoveTo(entry, now_ns, life);
  const VehicleEvidence taken = *voice;
  *voice = VehicleEvidence();
  life.SetJudged(static_cast<std::size_t>(voice - life.voices.begin()), false);
  step.counted = true;
  const HazardState from = life.state;
  // What an official has confirmed stands on his word, not on the vehicle's.
  if (!life.official) {
    TakeBack(entry, taken, life);
    Demote(entry, taken, now_ns, life);
  }
  if (life.state != HazardState::kGone) Settle(entry, now_ns, life, step);
  step.transition = LifecycleTransition{from, life.state, CutUtf8(why, kMaxEventReasonBytes)};
  return step;
}

LifecycleUpdate HazardLifecycle::Reinstate(const ClassModel& entry, const PresenceRecord& before,
                                           const std::function<double(std::uint64_t)>& malicious_of,
                                           const std::set<std::uint64_t>& withdrawn,
                                           const std::string& why, std::int64_t now_ns,
                                           PresenceRecord& life) const {
  const HazardState from = life.state;
  PresenceRecord restored = before;
  for (const std::uint64_t vehicle : withdrawn) {
    // As of the moment of before: time goes on below.
    Withdraw(entry, vehicle, why, restored.at_ns, restored);
  }
  std::vector<VehicleEvidence> since;
  for (const VehicleEvidence& voice : life.voices) {
    if (voice.vehicle == 0) continue;
    const bool is_known =
        std::any_of(before.voices.begin(), before.voices.end(), [&](const VehicleEvidence& old) {
          return old.vehicle == voice.vehicle && old.at_s >= voice.at_s;
        });
    if (!is_known) since.push_back(voice);
  }
  std::sort(since.begin(), since.end(),
            [](const VehicleEvidence& a, const VehicleEvidence& b) { return a.at_s < b.at_s; });
  for (const VehicleEvidence& voice : since) {
    Evidence word{voice.against ? EvidenceKind::kAnswerNo : EvidenceKind::kSighting, voice.vehicle,
                  Nanoseconds(voice.at_s)};
    word.malicious = malicious_of(voice.vehicle);
    Apply(entry, word, std::max(restored.at_ns, word.stamp_ns), restored);
  }
  LifecycleUpdate step;
  step.counted = true;
  if (restored.state != HazardState::kGone) Advance(entry, now_ns, restored);
  life = restored;
  step.transition = LifecycleTransition{from, life.state, CutUtf8(why, kMaxEventReasonBytes)};
  return step;
}

/// The odds as if the vehicle had said nothing.
void HazardLifecycle::TakeBack(const ClassModel& entry, const VehicleEvidence& taken,
                               PresenceRecord& life) const {
  double weight = 1e-3 * taken.weight_1000;
  // A voice for the hazard has faded with the odds.
  const double age_s = std::max(0.0, Seconds(life.at_ns) - taken.at_s);
  if (weight > 0) weight *= std::exp(-age_s / entry.survival.MeanLifeS());
  const auto less = [&](double log_odds, double by) {
    return std::clamp(log_odds - by, -max_log_odds_, max_log_odds_);
  };
  life.log_odds = less(life.log_odds, weight);
  life.undenied_log_odds = less(life.undenied_log_odds, std::max(0.0, weight));
  ForgetStamps(taken, life);
}

/// A hazard that stood on the withdrawn words alone is gone; one that too few others have seen is a
/// candidate again.
void HazardLifecycle::Demote(const ClassModel& entry, const VehicleEvidence& taken,
                             std::int64_t now_ns, PresenceRecord& life) const {
  if (taken.against || !IsOnMap(life.state)) return;
  const std::uint32_t supporters = Supporters(life);
  if (supporters == 0) {
    EnterLifecycleState(HazardState::kGone, now_ns, life);
  } else if (IsTold(life.state) && supporters < entry.confirmations) {
    EnterLifecycleState(HazardState::kCandidate, now_ns, life);
  }
}

/// One newcomer's word alone brings a hazard just to active_above. Were that asked of a class that
/// one vehicle confirms, a vehicle that was contradicted once would be believed nothing any more.
double HazardLifecycle::ActiveAbove(const ClassModel& entry) const {
  return entry.confirmations > 1 ? config_.active_above : config_.active_alone_above;
}

double HazardLifecycle::VerifyBelow(const ClassModel& entry) const {
  return entry.confirmations > 1 ? config_.verify_below
                                 : std::min(config_.verify_below, config_.active_alone_above);
}

std::optional<LifecycleTransition> HazardLifecycle::Decide(const ClassModel& entry,
                                                           const PresenceRecord& life) const {
  if (life.state == HazardState::kRejected) return DecideRejected(life);
  if (auto gone = DecideGone(life)) return gone;
  const double presence = ProbabilityOf(life.log_odds);
  const std::uint32_t supporters = Supporters(life);
  const std::uint32_t opponents = Opponents(life);
  switch (life.state) {
    case HazardState::kCandidate:
      if (supporters < entry.confirmations + opponents && !life.official) return std::nullopt;
      if (presence < ActiveAbove(entry)) return std::nullopt;
      return LifecycleTransitionOf(life, HazardState::kActive,
                                   "seen by " + LifecycleVehiclesText(supporters));
    case HazardState::kActive:
      if (presence >= VerifyBelow(entry)) return std::nullopt;
      return LifecycleTransitionOf(
          life, HazardState::kVerifying,
          LifecyclePresenceText(life.log_odds) +
              (opponents > 0 ? ": denied by " + LifecycleVehiclesText(opponents)
                             : ": not seen for " +
                                   LifecycleDurationText(Seconds(life.at_ns - life.last_yes_ns))));
    case HazardState::kVerifying:
      if (presence < config_.settled_above) return std::nullopt;
      return LifecycleTransitionOf(life, HazardState::kActive,
                                   "still there by " + LifecycleVehiclesText(supporters) + ", " +
                                       LifecyclePresenceText(life.log_odds));
    default:
      return std::nullopt;
  }
}

bool HazardLifecycle::IsDeniedAway(const PresenceRecord& life) const {
  return Opponents(life) >= config_.denying_vehicles &&
         ProbabilityOf(life.log_odds) < config_.gone_below;
}

std::optional<LifecycleTransition> HazardLifecycle::DecideGone(const PresenceRecord& life) const {
  if (IsDeniedAway(life)) {
    return LifecycleTransitionOf(life, HazardState::kGone,
                                 "denied by " + LifecycleVehiclesText(Opponents(life)) + ", " +
                                     LifecyclePresenceText(life.log_odds));
  }
  if (ProbabilityOf(life.undenied_log_odds) >= config_.gone_below) return std::nullopt;
  return LifecycleTransitionOf(life, HazardState::kGone,
                               "not seen for " +
                                   LifecycleDurationText(Seconds(life.at_ns - life.last_yes_ns)) +
                                   ", " + LifecyclePresenceText(life.undenied_log_odds));
}

std::optional<LifecycleTransition> HazardLifecycle::DecideRejected(
    const PresenceRecord& life) const {
  const std::uint32_t supporters = Supporters(life);
  if (supporters >= config_.reopen_vehicles &&
      ProbabilityOf(life.log_odds) >= config_.active_above) {
    return LifecycleTransitionOf(
        life, HazardState::kActive,
        "seen by " + LifecycleVehiclesText(supporters) + " after its rejection");
  }
  const std::int64_t heard_ns = std::max(life.since_ns, life.last_yes_ns);
  if (Seconds(life.at_ns - heard_ns) < config_.rejected_keep_s) return std::nullopt;
  return LifecycleTransitionOf(
      life, HazardState::kGone,
      "rejected, and not seen for " + LifecycleDurationText(Seconds(life.at_ns - heard_ns)));
}

double HazardLifecycle::Presence(const ClassModel& entry, const PresenceRecord& life,
                                 std::int64_t now_ns) const {
  if (life.state == HazardState::kRejected || now_ns <= life.at_ns) {
    return ProbabilityOf(life.log_odds);
  }
  return ProbabilityOf(FadedLifecycle(entry, life.log_odds, life, Seconds(now_ns - life.at_ns)));
}

std::int64_t HazardLifecycle::NextChangeNs(const ClassModel& entry,
                                           const PresenceRecord& life) const {
  if (life.state == HazardState::kGone) return kNever;
  if (life.state == HazardState::kRejected) {
    return std::max(life.since_ns, life.last_yes_ns) + Nanoseconds(config_.rejected_keep_s);
  }
  const auto falls_in_s = [&](double log_odds, double below) {
    const double share = below / ProbabilityOf(log_odds);
    return share >= 1 ? 0.0 : entry.survival.TimeTo(share, LifecycleAgeS(life, life.at_ns));
  };
  double soonest_s = falls_in_s(life.undenied_log_odds, config_.gone_below);
  if (Opponents(life) >= config_.denying_vehicles) {
    soonest_s = std::min(soonest_s, falls_in_s(life.log_odds, config_.gone_below));
  }
  if (life.state == HazardState::kActive) {
    soonest_s = std::min(soonest_s, falls_in_s(life.log_odds, VerifyBelow(entry)));
  }
  // A little later than computed, so that rounding does not make it too early.
  const double margin_s = 1e-3 + 1e-9 * (entry.survival.scale_s + LifecycleAgeS(life, life.at_ns));
  const double limited_s = std::min(soonest_s + margin_s, 1e9);
  return life.at_ns + Nanoseconds(limited_s);
}

}  // namespace livemap::zone
