#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "datasets/seeded_random.h"

namespace livemap::datasets {

/// What hides the sky from a receiver in a street: how high the houses' upper edges stand over it
/// on either side, seen across the street, radians over the horizon; 0: open.
struct SkyVisibility {
  double left_rad = 0;
  double right_rad = 0;

  /// Of the upper half space, by solid angle. A long wall of elevation a hides a wedge of the
  /// sphere between the ground and a plane tilted by a: a / pi of the sky.
  double HiddenShare() const;
  /// What the left side hides more than the right.
  double LeftSurplus() const;
};

/// The slow errors of satellite ranges that reach the receiver over reflecting house fronts, in
/// metres beside the position. Satellites behind the houses across the street are lost or come as
/// reflections, so that the error is larger across the street than along it (P. D. Groves, "Shadow
/// Matching: A New GNSS Positioning Technique for Urban Canyons", Journal of Navigation 64, 2011).
/// Its size follows the share of sky that houses hide, h:
///   across: sigma 2 M h, and a push of 2 M (h_left - h_right) to the right, away from the higher
///           side;
///   along:  sigma M h;
/// so that M is the sigma across the street where houses hide half of the sky. Both axes are
/// first-order Gauss-Markov processes that keep 1/e of themselves after 30 m of driving or 100 s of
/// standing. Sizes and shape of the model are chosen, not measured. Not thread-safe; the same seed
/// gives the same errors.
class GnssMultipath {
 public:
  static constexpr double kCorrelationM = 30;
  static constexpr double kCorrelationS = 100;

  /// `sigma_m` is M; 0: no errors. Throws Error when it is negative or not finite.
  GnssMultipath(double sigma_m, std::uint64_t seed);

  /// East and north, metres, at `time_s` (not decreasing) after `driven_m` metres of driving (not
  /// decreasing) in a street of direction `heading_rad` (counter-clockwise from east).
  Eigen::Vector2d ErrorAt(double time_s, double driven_m, double heading_rad,
                          const SkyVisibility& sky);

 private:
  const double sigma_m_;
  SeededRandom random_;
  Eigen::Vector2d unit_ = Eigen::Vector2d::Zero();  ///< Sigma 1; along, left.
  bool started_ = false;
  double time_s_ = 0;
  double driven_m_ = 0;
};

}  // namespace livemap::datasets
