#pragma once

#include <vector>

#include "zone/belief/hazard_evidence.h"
#include "zone/belief/vehicle_trust.h"
#include "zone/model/presence_record.h"

namespace livemap::zone {

/// Judges the evidence that vehicles gave of a hazard once others have settled the matter, so that
/// VehicleTrust learns how far to believe each vehicle. One verdict at most comes of each piece of
/// evidence while it lasts; its likelihood ratio is that of a vehicle that says what it likes, one
/// or the other by halves, against an honest one. Knows no state but its settings.
class TrustUpdate {
 public:
  struct Config {
    double prior_presence = 0.2;  ///< Before the first vehicle gives evidence.
    double certain_above = 0.85;  ///< Presence from which on a hazard settles what was said of it.
    double suspect_above = 0.5;   ///< A vehicle this likely malicious bears nothing out.
    double max_trust_step = 1;    ///< No one verdict weighs more, log odds; an official's
    double official_weight = 2;   ///< ...weighs this many times as much as a vehicle's.
  };

  explicit TrustUpdate(const Config& config) : config_(config) {}

  /// `seen` supports the hazard. Earlier evidence is judged by what all others say: no vehicle
  /// bears out its own evidence. What is judged is noted in `life`.
  std::vector<Verdict> AfterSighting(const ClassModel& entry, const Evidence& seen,
                                     PresenceRecord& life) const;
  /// The hazard is denied away.
  std::vector<Verdict> AfterDenial(const ClassModel& entry, const PresenceRecord& life) const;
  /// An official says whether the hazard is `there`.
  std::vector<Verdict> AfterDecision(const ClassModel& entry, bool there,
                                     const PresenceRecord& life) const;

 private:
  double WrongYes(const ClassModel& entry) const;
  double WrongNo(const ClassModel& entry) const;

  Config config_;
};

}  // namespace livemap::zone
