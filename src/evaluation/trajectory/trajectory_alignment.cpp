#include "evaluation/trajectory/trajectory_alignment.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/error.h"
#include "datasets/stamp_pairs.h"

namespace livemap::evaluation {
namespace {

constexpr Eigen::Index kMinScalePairs = 3;

Eigen::Matrix3Xd PositionsToAlign(const std::vector<datasets::StampedPose>& poses) {
  Eigen::Matrix3Xd positions(3, static_cast<Eigen::Index>(poses.size()));
  Eigen::Index column = 0;
  for (const datasets::StampedPose& pose : poses) {
    positions.col(column++) = pose.world_from_camera.translation();
  }
  return positions;
}

/// Whether positions about their mean are all one, but for rounding.
bool Stands(const Eigen::Matrix3Xd& centred, const Eigen::Vector3d& mean) {
  const double variance = centred.squaredNorm() / static_cast<double>(centred.cols());
  return variance <= 1e-20 * std::max(1.0, mean.squaredNorm());
}

/// A scale needs motion in both, and more pairs than it can fit whatever they are.
void CheckScalable(const Eigen::Matrix3Xd& true_centred, const Eigen::Vector3d& true_mean,
                   const Eigen::Matrix3Xd& centred, const Eigen::Vector3d& mean) {
  if (centred.cols() < kMinScalePairs) {
    throw Error("there are " + std::to_string(centred.cols()) +
                " pairs of poses, on which any estimate fits with a scale of its own, at least " +
                std::to_string(kMinScalePairs) + " are needed");
  }
  for (const auto& [name, stands] :
       {std::pair("the estimate does", Stands(centred, mean)),
        std::pair("the truth does", Stands(true_centred, true_mean))}) {
    if (stands) throw Error(std::string(name) + " not move, so no scale can be found for it");
  }
}

/// Umeyama's closed form; the equation numbers are those of his paper.
Alignment AlignAllPairs(const TrajectoryPairs& pairs, bool with_scale) {
  const Eigen::Matrix3Xd truth = PositionsToAlign(pairs.truth);
  const Eigen::Matrix3Xd estimate = PositionsToAlign(pairs.estimate);
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
    CheckScalable(true_centred, true_mean, centred, mean);
    alignment.scale = svd.singularValues().dot(signs) / variance;
    const double own_scale = std::sqrt(true_centred.squaredNorm() / n / variance);
    if (!(alignment.scale > 1e-9 * own_scale)) {
      throw Error("truth and estimate have no motion in common, so no scale can be found");
    }
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
      return AlignAllPairs(pairs, false);
    case AlignmentKind::kSim3:
      return AlignAllPairs(pairs, true);
    case AlignmentKind::kOrigin:
      return {1, pairs.truth[0].world_from_camera * pairs.estimate[0].world_from_camera.inverse()};
    case AlignmentKind::kNone:
      break;
  }
  return {};
}

}  // namespace livemap::evaluation
