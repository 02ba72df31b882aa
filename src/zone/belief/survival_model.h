#pragma once

#include <map>
#include <string>

#include "protocol/hazard_catalogue.h"

namespace livemap::zone {

/// How long hazards of one class live: each ends at a constant but unknown rate, and what is known
/// of the rate is a Gamma distribution of `shape` and `scale_s`. Then the life is Lomax (Pareto II)
/// distributed. A plain value, cheap to copy.
struct ClassSurvival {
  double shape = 5;              ///< > 1: pseudo-count of ended lives, plus one.
  double scale_s = 4 * 86400.0;  ///< > 0: seconds that those lives add up to.

  /// Probability that a hazard that stands at age `age_s` still stands `dt_s` later:
  /// ((scale + age) / (scale + age + dt))^shape. 1 for dt_s <= 0; a negative age counts as 0.
  double Survival(double age_s, double dt_s) const;
  /// After how many seconds Survival falls to `probability`, 0 < probability <= 1.
  double TimeTo(double probability, double age_s) const;
  /// Integral of Survival over the next `dt_s` seconds.
  double ExpectedTimeStanding(double age_s, double dt_s) const;
  /// Expected life of a new hazard, seconds: scale / (shape - 1).
  double MeanLifeS() const { return scale_s / (shape - 1); }
};

/// What one hazard's history teaches of its class: that it stood for `stood_s` more seconds, and
/// whether it ended then. Nothing by default.
struct LifetimeObservation {
  double stood_s = 0;
  bool ended = false;
};

/// What was learned of one class: the only state of SurvivalModel, to be stored as it is.
struct LearnedLifetime {
  double ended = 0;    ///< Lives that ended, old ones counted less; >= 0, finite.
  double stood_s = 0;  ///< Time that hazards stood, those that still stand included; the same.
};

/// Survival of every class, learned from the zone's own hazards. Knows no clock; not thread-safe.
///
/// Exponential lives with a Gamma prior over the rate: n ended lives and T seconds of standing make
/// Gamma(a0 + n, b0 + T), whatever number of hazards still stands: a standing one (censored) adds
/// to T and not to n, which is all that its likelihood exp(-rate t) says. Source: Gelman et al.,
/// "Bayesian Data Analysis" (3rd ed. 2013), 2.6; Klein and Moeschberger, "Survival Analysis"
/// (2003), 3.5. Averaging over the rate gives the Lomax law (K. Lomax, "Business failures", J. Am.
/// Stat. Assoc. 49, 1954), whose tail is heavier than the exponential's: what stood for long is
/// expected to stand for longer, as it should be where one class mixes short lives and long ones (a
/// pothole on a main road and one in a lane). A pure exponential would drop the long-lived;
/// log-normal lives (usual for incidents: T. Golob et al., Accident Analysis and Prevention 19,
/// 1987) have no state that is two numbers, and a poll corrects what the form gets wrong. So that
/// the tail never becomes exponential, and that habits may change, no more than `memory` ended
/// lives are remembered.
class SurvivalModel {
 public:
  struct Config {
    double prior_weight = 4;  ///< The catalogue's expected life counts as this many ended lives.
    double memory = 50;       ///< Ended lives that count at most; older ones fade. >= 1.
  };

  SurvivalModel(protocol::HazardCatalogue catalogue, Config config);
  explicit SurvivalModel(protocol::HazardCatalogue catalogue);

  /// Takes in what the store kept. Throws Error naming the class unless both numbers are finite and
  /// not negative.
  void Restore(const std::string& class_name, const LearnedLifetime& learned);
  /// Learns from a step of a hazard's life (see HazardLifecycle); ignores what is not finite or
  /// negative.
  void Learn(const std::string& class_name, const LifetimeObservation& lesson);
  /// Takes a lesson back that was learned before; nothing falls below zero.
  void Unlearn(const std::string& class_name, const LifetimeObservation& lesson);
  /// The class's survival as known now; of the catalogue's expected life as long as nothing was
  /// learned: then its mean is exactly `expected_life_s`.
  ClassSurvival Of(const std::string& class_name) const;
  /// What was learned, by class, to be stored.
  const std::map<std::string, LearnedLifetime>& learned() const { return learned_; }

 private:
  protocol::HazardCatalogue catalogue_;
  Config config_;
  std::map<std::string, LearnedLifetime> learned_;
};

}  // namespace livemap::zone
