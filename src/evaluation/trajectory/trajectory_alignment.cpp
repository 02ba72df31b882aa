#include "evaluation/trajectory/trajectory_alignment.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "datasets/stamp_pairs.h"

namespace livemap::evaluation {
namespace {

Eigen::Matrix3Xd Positions(const std::vector<datasets::StampedPose>& poses) {
  Eigen::Matrix3Xd positions(3, static_cast<Eigen::Index>(poses.size()));
  Eigen::Index column = 0;
  for (const datasets::StampedPose& pose : poses) {
    positions.col(column++) = pose.world_from_camera.translation();
  }
  return positions;
}

/// Umeyama's closed form; the equation numbers are those of his paper.
Alignment AlignAll(const TrajectoryPairs& pairs, bool with_scale) {
  const Eigen::Matrix3Xd truth = Positions(pairs.truth);
  const Eigen::Matrix3Xd estimate = Positions(pairs.estimate);
  const auto n = static_cast<double>(pairs.truth.size());
  // (34), (35): the means.
  const Eigen::Vector3d true_mean = truth.rowwise().mean();
  const Eigen::Vector3d mean = estimate.rowwise().mean();
  const Eigen::Matrix3Xd true_centred = truth.colwise() - true_mean;
  const Eigen::Matrix3Xd centred = estimate.colwise() - mean;
  // (36), (38): the estimate's variance, the covariance of both.
  const double variance = centred.squaredNorm() / n;
  const Eigen::Matrix3d covariance = true_centred * centred.transpose() / n;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  // (39), (43): the nearest rotation, never a reflection.
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) signs.z() = -1;
  Alignment alignment;
  // (42): the scale.
  if (with_scale) {
    if (variance <= 1e-20 * std::max(1.0, mean.squaredNorm())) {
      throw Error("the estimate does not move, so no scale can be found for it");
    }
    alignment.scale = svd.singularValues().dot(signs) / variance;
  }
  // (40), (41): rotation and translation.
  const Eigen::Matrix3d rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  alignment.truth_from_estimate.linear() = rotation;
  alignment.truth_from_estimate.translation() = true_mean - alignment.scale * (rotation * mean);
  return alignment;
}

}  // namespace

std::vector<std::int64_t> StampsOf(const std::vector<datasets::StampedPose>& poses,
                                   std::int64_t moved_by_ns) {
  std::vector<std::int64_t> stamps;
  stamps.reserve(poses.size());
  for (const datasets::StampedPose& pose : poses) stamps.push_back(pose.stamp_ns + moved_by_ns);
  return stamps;
}

TrajectoryPairs Associate(const std::vector<datasets::StampedPose>& truth,
                          const std::vector<datasets::StampedPose>& estimate,
                          const AssociationConfig& options) {
  TrajectoryPairs pairs;
  const std::int64_t offset_ns = std::llround(options.offset_s * 1e9);
  for (const auto& [true_index, index] :
       datasets::PairNearestStamps(StampsOf(truth, -offset_ns), StampsOf(estimate, 0),
                                   std::llround(options.max_difference_s * 1e9))) {
    pairs.truth.push_back(truth[true_index]);
    pairs.estimate.push_back(estimate[index]);
  }
  return pairs;
}

Alignment Align(const TrajectoryPairs& pairs, AlignmentKind kind) {
  if (pairs.truth.empty()) throw Error("there are no pairs of poses to align");
  switch (kind) {
    case AlignmentKind::kSe3:
      return AlignAll(pairs, false);
    case AlignmentKind::kSim3:
      return AlignAll(pairs, true);
    case AlignmentKind::kOrigin:
      return {1, pairs.truth[0].world_from_camera * pairs.estimate[0].world_from_camera.inverse()};
    case AlignmentKind::kNone:
      break;
  }
  return {};
}

}  // namespace livemap::evaluation
