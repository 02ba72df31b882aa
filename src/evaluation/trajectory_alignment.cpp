#include "evaluation/trajectory_alignment.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <queue>
#include <tuple>

#include "base/error.h"

namespace livemap {
namespace {

/// Which elements of a row are still free, next to a place; elements are taken one by one.
class FreeRow {
 public:
  explicit FreeRow(std::size_t size) : after_(size + 1), before_(size + 1) {
    std::iota(after_.begin(), after_.end(), 0);
    std::iota(before_.begin(), before_.end(), 0);
  }

  void Take(std::size_t index) {
    after_[index] = index + 1;
    before_[index + 1] = index;
  }
  bool IsFree(std::size_t index) const { return after_[index] == index; }
  /// The first free one from `index` on, the row's size when there is none.
  std::size_t After(std::size_t index) { return Follow(after_, index); }
  /// One more than the last free one before `index`, 0 when there is none.
  std::size_t Before(std::size_t index) { return Follow(before_, index); }

 private:
  /// Follows the links and shortens them.
  static std::size_t Follow(std::vector<std::size_t>& links, std::size_t index) {
    while (links[index] != index) {
      links[index] = links[links[index]];
      index = links[index];
    }
    return index;
  }

  std::vector<std::size_t> after_;
  std::vector<std::size_t> before_;
};

/// Distance of the stamps in ns, index of the true pose, index of the estimated one: ordered as
/// they are taken.
using Candidate = std::tuple<std::int64_t, std::size_t, std::size_t>;

/// Finds for each true stamp the nearest estimated one that is still free.
class Associator {
 public:
  Associator(const std::vector<StampedPose>& truth, const std::vector<StampedPose>& estimate,
             const AssociationOptions& options)
      : truth_(truth),
        estimate_(estimate),
        offset_ns_(std::llround(options.offset_s * 1e9)),
        max_difference_ns_(std::llround(options.max_difference_s * 1e9)),
        free_(estimate.size()) {}

  /// (true index, estimated index) in the order of the former.
  std::vector<std::pair<std::size_t, std::size_t>> Run() {
    for (std::size_t i = 0; i < truth_.size(); ++i) Offer(i);
    std::vector<std::pair<std::size_t, std::size_t>> matches;
    // A true stamp's candidate can only get farther, so the nearest one that is free is the nearest
    // of all pairs.
    while (!candidates_.empty()) {
      const auto [difference, true_index, index] = candidates_.top();
      candidates_.pop();
      if (free_.IsFree(index)) {
        free_.Take(index);
        matches.emplace_back(true_index, index);
      } else {
        Offer(true_index);
      }
    }
    std::sort(matches.begin(), matches.end());
    return matches;
  }

 private:
  void Offer(std::size_t true_index) {
    const std::int64_t stamp = truth_[true_index].stamp_ns - offset_ns_;
    const auto place = std::lower_bound(
        estimate_.begin(), estimate_.end(), stamp,
        [](const StampedPose& pose, std::int64_t at) { return pose.stamp_ns < at; });
    const auto middle = static_cast<std::size_t>(place - estimate_.begin());
    const std::size_t after = free_.After(middle);
    const std::size_t before = free_.Before(middle);
    Candidate nearest(max_difference_ns_, true_index, 0);
    if (before > 0) {
      nearest = std::min(nearest,
                         Candidate(stamp - estimate_[before - 1].stamp_ns, true_index, before - 1));
    }
    if (after < estimate_.size()) {
      nearest = std::min(nearest, Candidate(estimate_[after].stamp_ns - stamp, true_index, after));
    }
    if (std::get<0>(nearest) < max_difference_ns_) candidates_.push(nearest);
  }

  const std::vector<StampedPose>& truth_;
  const std::vector<StampedPose>& estimate_;
  const std::int64_t offset_ns_;
  const std::int64_t max_difference_ns_;
  FreeRow free_;
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> candidates_;
};

Eigen::Matrix3Xd Positions(const std::vector<StampedPose>& poses) {
  Eigen::Matrix3Xd positions(3, static_cast<Eigen::Index>(poses.size()));
  Eigen::Index column = 0;
  for (const StampedPose& pose : poses) {
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

TrajectoryPairs Associate(const std::vector<StampedPose>& truth,
                          const std::vector<StampedPose>& estimate,
                          const AssociationOptions& options) {
  TrajectoryPairs pairs;
  for (const auto& [true_index, index] : Associator(truth, estimate, options).Run()) {
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

}  // namespace livemap
