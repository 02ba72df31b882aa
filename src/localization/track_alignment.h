#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "localization/planar.h"

namespace livemap::localization {

/// The same place in the odometry's track and by a fix on the map.
struct TrackPair {
  Eigen::Vector2d track_m;
  Eigen::Vector2d map_m;
  double sigma_m = 1;  ///< Of the fix, per axis.
};

/// How much wider than stated errors scatter, by the median of their squared Mahalanobis distances
/// in the plane; at least 1 and at most 20.
double Widening(std::vector<double> squared_distances);

struct TrackAlignment {
  PlanarPose map_from_track;
  double yaw_sigma_rad = 0;
  /// How much wider than stated the fixes scatter, at least 1.
  double widening = 1;
  std::vector<bool> agrees;  ///< Which pairs were used.
};

/// The turn and shift that bring a track onto the fixes, though some of these are far off. None
/// when less than `min_pairs` or half of the pairs agree (squared distance over widened variance
/// at most `gate`), or all lie in one place. The same input gives the same answer.
///
/// By the least median of squares, P. J. Rousseeuw, J. Am. Stat. Assoc. 79 (1984): right while less
/// than half of the fixes are wrong, whatever they state.
std::optional<TrackAlignment> AlignTrack(const std::vector<TrackPair>& pairs, double gate,
                                         std::size_t min_pairs);

}  // namespace livemap::localization
