#include "zone/belief/trust_update.h"

#include <algorithm>
#include <cmath>

#include "common/log_odds.h"
#include "common/time.h"

namespace livemap::zone {
namespace {

/// Who says what it likes says one or the other.
constexpr double kAnyWord = 0.5;

double TrustForRightYes(const ClassModel& entry) { return std::log(kAnyWord / entry.hit_rate); }
double TrustForRightNo(const ClassModel& entry) {
  return std::log(kAnyWord / (1 - entry.false_rate));
}

/// The odds that the hazard was ever there, from what was said for it alone.
double TrustOddsOfSupport(const PresenceRecord& life, double prior) {
  double log_odds = LogOddsOf(prior);
  for (const VehicleEvidence& voice : life.voices) {
    if (voice.vehicle != 0 && !voice.against)
      log_odds += 1e-3 * std::max<int>(0, voice.weight_1000);
  }
  return log_odds;
}

}  // namespace

double TrustUpdate::WrongYes(const ClassModel& entry) const {
  return std::clamp(std::log(kAnyWord / entry.false_rate), 0.0, config_.max_trust_step);
}

double TrustUpdate::WrongNo(const ClassModel& entry) const {
  return std::clamp(std::log(kAnyWord / (1 - entry.hit_rate)), 0.0, config_.max_trust_step);
}

std::vector<Verdict> TrustUpdate::AfterSighting(const ClassModel& entry, const Evidence& seen,
                                                PresenceRecord& life) const {
  std::vector<Verdict> verdicts;
  if (seen.malicious >= config_.suspect_above) return verdicts;
  for (std::size_t i = 0; i < kMaxEvidencePerHazard; ++i) {
    const VehicleEvidence& voice = life.voices[i];
    if (voice.vehicle == 0 || voice.vehicle == seen.vehicle || life.IsJudged(i)) continue;
    if (Seconds(seen.stamp_ns) <= voice.at_s) continue;
    if (ProbabilityOf(life.log_odds - 1e-3 * voice.weight_1000) < config_.certain_above) continue;
    life.SetJudged(i, true);
    verdicts.push_back(
        {voice.vehicle, voice.against ? WrongNo(entry) : TrustForRightYes(entry), seen.vehicle});
  }
  return verdicts;
}

/// Three things may have happened: there never was anything; it ended between the last word for it
/// and the first against it; or it stands and every opponent missed it.
std::vector<Verdict> TrustUpdate::AfterDenial(const ClassModel& entry,
                                              const PresenceRecord& life) const {
  std::vector<Verdict> verdicts;
  const double real =
      life.official ? 1 : ProbabilityOf(TrustOddsOfSupport(life, config_.prior_presence));
  const double gap_s = std::max(0.0, Seconds(life.first_no_ns - life.last_yes_ns));
  const double age_s = std::max(0.0, Seconds(life.last_yes_ns - life.first_seen_ns));
  const double stands = entry.survival.Survival(age_s, gap_s);
  double missed = 1;
  std::uint64_t opponent = 0;
  for (const VehicleEvidence& voice : life.voices) {
    if (!voice.Counts() || !voice.against) continue;
    missed *= (1 - entry.hit_rate) / (1 - entry.false_rate);
    opponent = voice.vehicle;
  }
  const double invented = (1 - real) / (1 - real + real * (1 - stands + stands * missed));
  std::uint64_t other_opponent = opponent;
  for (std::size_t i = 0; i < kMaxEvidencePerHazard; ++i) {
    const VehicleEvidence& voice = life.voices[i];
    if (voice.vehicle == 0 || life.IsJudged(i)) continue;
    if (!voice.against) {
      verdicts.push_back({voice.vehicle, invented * WrongYes(entry), opponent});
      continue;
    }
    const std::uint64_t voucher = voice.vehicle == opponent ? other_opponent : opponent;
    if (voucher != voice.vehicle) {
      verdicts.push_back({voice.vehicle, TrustForRightNo(entry), voucher});
    }
    if (voice.Counts()) other_opponent = voice.vehicle;
  }
  return verdicts;
}

std::vector<Verdict> TrustUpdate::AfterDecision(const ClassModel& entry, bool there,
                                                const PresenceRecord& life) const {
  std::vector<Verdict> verdicts;
  for (const VehicleEvidence& voice : life.voices) {
    if (voice.vehicle == 0) continue;
    const double wrong = voice.against ? WrongNo(entry) : WrongYes(entry);
    const double right = voice.against ? TrustForRightNo(entry) : TrustForRightYes(entry);
    const double ratio = voice.against == there ? wrong : right;
    verdicts.push_back({voice.vehicle, config_.official_weight * ratio, 0});
  }
  return verdicts;
}

}  // namespace livemap::zone
