// What officials do with a hazard: the part of HazardLifecycle that no vehicle has a say in.
#include <algorithm>
#include <cmath>

#include "common/time.h"
#include "zone/belief/hazard_lifecycle_internal.h"

namespace livemap::zone {
namespace {

/// The newest stamp of a vehicle that counts and speaks for the hazard; 0 without one.
std::uint32_t NewestYesS(const PresenceRecord& life) {
  std::uint32_t newest_s = 0;
  for (const VehicleEvidence& voice : life.voices) {
    if (voice.Counts() && !voice.against) newest_s = std::max(newest_s, voice.at_s);
  }
  return newest_s;
}

bool AnyAgainst(const PresenceRecord& life) {
  return std::any_of(life.voices.begin(), life.voices.end(),
                     [](const VehicleEvidence& voice) { return voice.Counts() && voice.against; });
}

/// What the hazard remembers of times, had the vehicle not spoken.
void ForgetStamps(const VehicleEvidence& taken, PresenceRecord& life) {
  if (taken.against) {
    if (!AnyAgainst(life)) life.first_no_ns = 0;
    return;
  }
  if (static_cast<std::uint32_t>(std::max(0.0, Seconds(life.last_yes_ns))) > taken.at_s) return;
  life.last_yes_ns = std::max(life.first_seen_ns, Nanoseconds(NewestYesS(life)));
}

}  // namespace

std::string DecisionText(const std::string& done, const std::string& official,
                         const std::string& reason) {
  return ReasonText(done + " by " + official + (reason.empty() ? "" : ": " + reason));
}

LifecycleUpdate HazardLifecycle::Confirm(const ClassModel& entry, const std::string& official,
                                         const std::string& reason, std::int64_t now_ns,
                                         PresenceRecord& life) const {
  LifecycleUpdate step;
  if (life.state == HazardState::kGone) return step;
  const bool told = IsTold(life.state);
  MoveTo(entry, now_ns, life);
  const std::int64_t stood_until_ns = told ? life.last_yes_ns : life.first_seen_ns;
  JudgeOfficially(entry, true, life, step);
  for (VehicleEvidence& voice : life.voices) {
    if (voice.against) voice = VehicleEvidence();
  }
  RecordConfirmation(now_ns, life);
  life.official = true;
  life.log_odds = life.undenied_log_odds = max_log_odds_;
  step.counted = true;
  step.lesson.stood_s = Seconds(life.last_yes_ns - stood_until_ns);
  // Confirmed again it stays what it is; that somebody looked is an event all the same.
  step.transition =
      Transition(life, HazardState::kActive, DecisionText("confirmed", official, reason));
  if (life.state != HazardState::kActive) Enter(HazardState::kActive, now_ns, life);
  return step;
}

LifecycleUpdate HazardLifecycle::Reject(const ClassModel& entry, const std::string& official,
                                        const std::string& reason, std::int64_t now_ns,
                                        PresenceRecord& life) const {
  LifecycleUpdate step;
  if (!IsOnMap(life.state)) return step;
  JudgeOfficially(entry, false, life, step);
  step.transition =
      Transition(life, HazardState::kRejected, DecisionText("rejected", official, reason));
  Enter(HazardState::kRejected, now_ns, life);
  // From here on it must be shown anew that there is something.
  life.official = false;
  life.voices = {};
  life.judged = 0;
  life.first_no_ns = 0;
  life.at_ns = std::max(life.at_ns, now_ns);
  life.log_odds = life.undenied_log_odds = LogOdds(config_.prior_presence);
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
  step.transition = LifecycleTransition{from, life.state, ReasonText(why)};
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
    Enter(HazardState::kGone, now_ns, life);
  } else if (IsTold(life.state) && supporters < entry.confirmations) {
    Enter(HazardState::kCandidate, now_ns, life);
  }
}

}  // namespace livemap::zone
