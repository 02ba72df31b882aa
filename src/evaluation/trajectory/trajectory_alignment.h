#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "datasets/sequences.h"

namespace livemap::evaluation {

/// Which true pose belongs to which estimated one, and where the estimate's world lies in the true
/// one. Trajectories are in the order of their stamps, each stamp once.

struct AssociationConfig {
  double max_difference_s = 0.02;  ///< Stamps nearer than this may belong together.
  double offset_s = 0;             ///< Added to the estimate's stamps first.
};

/// Poses that belong together: truth[i] and estimate[i], in the order of the true stamps.
struct TrajectoryPairs {
  std::vector<datasets::StampedPose> truth;
  std::vector<datasets::StampedPose> estimate;  ///< Stamps as in the file, without the offset.
};

/// The poses' stamps in nanoseconds, each later by `moved_by_ns`.
std::vector<std::int64_t> StampsOf(const std::vector<datasets::StampedPose>& poses,
                                   std::int64_t moved_by_ns);

/// PairNearestStamps over the true stamps and the estimate's.
TrajectoryPairs Associate(const std::vector<datasets::StampedPose>& truth,
                          const std::vector<datasets::StampedPose>& estimate,
                          const AssociationConfig& options);

/// What an estimate is freed of before its positions are compared.
enum class AlignmentKind {
  kNone,    ///< Nothing.
  kSe3,     ///< Rotation and translation that fit all pairs best.
  kSim3,    ///< The same and a scale: for one camera without depth.
  kOrigin,  ///< The first pair's poses are laid on each other.
};

/// A point of the estimate's world to the true one: rotation * (scale * point) + translation.
struct Alignment {
  double scale = 1;
  Eigen::Isometry3d truth_from_estimate = Eigen::Isometry3d::Identity();  ///< Of the scaled point.

  Eigen::Vector3d operator()(const Eigen::Vector3d& point) const {
    return truth_from_estimate * (scale * point);
  }
};

/// kSe3 and kSim3 minimise the sum of squared distances of the positions in closed form (Umeyama,
/// "Least-squares estimation of transformation parameters between two point patterns", 1991; equals
/// Horn's method in evaluate_ate.py). On a straight line the rotation about it is arbitrary. Throws
/// Error without pairs, and for a scale with fewer than three pairs, or when truth or estimate does
/// not move, or they have no motion in common.
Alignment Align(const TrajectoryPairs& pairs, AlignmentKind kind);

}  // namespace livemap::evaluation
