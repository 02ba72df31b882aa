#include "odometry/mounting/mounting_estimator.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/median.h"

namespace livemap::odometry {
namespace {

constexpr double kUnknownMounting = std::numeric_limits<double>::infinity();
constexpr double kSteepestSlope = 2;  // Of what is taken for a direction of travel or a normal.
constexpr double kTuning = 1.5;       // Huber's, standard deviations.
constexpr int kMeanSteps = 8;

struct RobustMean {
  double value = 0;
  double spread = 0;  // Standard deviation of one value.
  double share = 1;   // How many count, of all.
};

/// Huber's mean of values, which are not empty, with their own scatter but at least `least_spread`.
RobustMean HuberMean(const std::vector<double>& values, double least_spread) {
  RobustMean mean;
  mean.value = MedianOf(values);
  std::vector<double> sizes;
  sizes.reserve(values.size());
  for (const double value : values) sizes.push_back(std::abs(value - mean.value));
  mean.spread = std::max(least_spread, kMedianToSigma * MedianOf(sizes));
  for (int step = 0; step < kMeanSteps; ++step) {
    double sum = 0, weights = 0;
    for (const double value : values) {
      const double size = std::abs(value - mean.value);
      const double weight = std::min(1.0, kTuning * mean.spread / std::max(size, 1e-12));
      sum += weight * value;
      weights += weight;
    }
    mean.value = sum / weights;
    mean.share = weights / static_cast<double>(values.size());
  }
  return mean;
}

}  // namespace

void MountingEstimator::AddTravel(const Eigen::Vector3d& direction, double way_m) {
  // Written so that NaN is refused.
  if (!(way_m > 0 && way_m < 1000)) return;
  const double x = direction.x() / direction.z(), y = direction.y() / direction.z();
  if (!(direction.z() > 0 && std::abs(x) < kSteepestSlope && std::abs(y) < kSteepestSlope)) return;
  open_[kTravelX].push_back(x);
  open_[kTravelY].push_back(y);
  open_way_m_ += way_m;
  if (open_way_m_ >= config_.block_m) CloseBlock();
}

void MountingEstimator::AddRoad(const RoadPlane& road, double metres_sigma) {
  const double x = road.down.x() / road.down.y(), z = road.down.z() / road.down.y();
  if (!(road.down.y() > 0 && std::abs(x) < kSteepestSlope && std::abs(z) < kSteepestSlope)) return;
  if (!(road.distance > 0 && std::isfinite(road.distance))) return;
  open_[kRoadX].push_back(x);
  open_[kRoadZ].push_back(z);
  if (!(metres_sigma >= 0 && std::isfinite(metres_sigma))) return;
  open_[kLogHeight].push_back(std::log(road.distance));
  open_[kMetresSigma].push_back(metres_sigma);
}

void MountingEstimator::CloseBlock() {
  Values block;
  block.fill(std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = 0; i < kMeasured; ++i) {
    if (open_[i].size() >= config_.least_in_block) block[i] = HuberMean(open_[i], 1e-6).value;
    open_[i].clear();
  }
  open_way_m_ = 0;
  if (std::isnan(block[kTravelX])) return;
  blocks_.push_back(block);
  if (blocks_.size() > config_.blocks_kept) blocks_.pop_front();
  NoticeKnock();
}

/// Of the blocks from `begin` on, before `end`.
MountingEstimator::Mean MountingEstimator::MeanOf(int which, std::size_t begin, std::size_t end,
                                                  bool floors) const {
  const auto index = static_cast<std::size_t>(which);
  std::vector<double> values;
  for (std::size_t i = begin; i < end; ++i) {
    if (!std::isnan(blocks_[i][index])) values.push_back(blocks_[i][index]);
  }
  Mean result;
  result.blocks = values.size();
  if (values.empty()) return result;
  const bool height = which == kLogHeight;
  const double prior = height ? config_.prior_height : config_.prior_angle_rad;
  const RobustMean mean = HuberMean(values, 0.1 * prior);
  result.value = mean.value;
  double squares = config_.prior_blocks * prior * prior;
  for (const double value : values) {
    const double size = std::min(std::abs(value - mean.value), 3 * std::max(mean.spread, prior));
    squares += size * size;
  }
  const auto count = static_cast<double>(values.size());
  result.variance = squares / (config_.prior_blocks + count) / (count * mean.share);
  if (floors) {
    const double floor = height ? config_.height_floor : config_.angle_floor_rad;
    result.variance += floor * floor;
  }
  if (height) {
    // Blocks that share the error of their metres scatter by less than they are wrong.
    const double metres = MeanOf(kMetresSigma, begin, end, false).value;
    result.variance += metres * metres * std::min(1.0, config_.blocks_per_metres_error / count);
  }
  return result;
}

MountingEstimator::Means MountingEstimator::MeansOf(std::size_t begin, std::size_t end,
                                                    bool floors) const {
  Means means;
  for (int which = 0; which < kMeasured; ++which) {
    means[static_cast<std::size_t>(which)] = MeanOf(which, begin, end, floors);
  }
  return means;
}

/// Forward and down need not be at right angles as they were measured: the surer one moves less.
std::optional<MountingEstimate> MountingEstimator::EstimateOf(const Means& means,
                                                              const Mounting& otherwise) const {
  if (means[kTravelX].blocks < config_.least_blocks) return std::nullopt;
  MountingEstimate estimate;
  Eigen::Vector3d forward =
      Eigen::Vector3d(means[kTravelX].value, means[kTravelY].value, 1).normalized();
  estimate.roll_known = means[kRoadX].blocks >= config_.least_blocks;
  estimate.height_known = means[kLogHeight].blocks >= config_.least_blocks;
  Eigen::Vector3d down = AxesInCamera(otherwise).down;
  double travel_share = 1;
  if (estimate.roll_known) {
    down = Eigen::Vector3d(means[kRoadX].value, 1, means[kRoadZ].value).normalized();
    const double travel = means[kTravelY].variance, road = means[kRoadZ].variance;
    travel_share = road / (travel + road);
    const double skew = forward.dot(down);
    forward = (forward - (1 - travel_share) * skew * down).normalized();
  }
  down = (down - forward.dot(down) * forward).normalized();
  estimate.mounting = MountingOfAxes({forward, down});
  estimate.mounting.height_m =
      estimate.height_known ? std::exp(means[kLogHeight].value) : otherwise.height_m;
  estimate.sigma.yaw_rad = std::sqrt(means[kTravelX].variance);
  estimate.sigma.pitch_rad = std::sqrt(
      travel_share * travel_share * means[kTravelY].variance +
      (estimate.roll_known ? (1 - travel_share) * (1 - travel_share) * means[kRoadZ].variance : 0));
  estimate.sigma.roll_rad =
      estimate.roll_known ? std::sqrt(means[kRoadX].variance) : kUnknownMounting;
  estimate.sigma.height_m = estimate.height_known
                                ? estimate.mounting.height_m * std::sqrt(means[kLogHeight].variance)
                                : kUnknownMounting;
  return estimate;
}

std::optional<MountingEstimate> MountingEstimator::Estimate(const Mounting& otherwise) const {
  return EstimateOf(MeansOf(0, blocks_.size(), true), otherwise);
}

std::optional<Eigen::Vector3d> MountingEstimator::TravelSoFar() const {
  std::vector<double> x = open_[kTravelX], y = open_[kTravelY];
  const std::size_t newest = std::min<std::size_t>(blocks_.size(), 2);
  for (std::size_t i = blocks_.size() - newest; i < blocks_.size(); ++i) {
    x.insert(x.end(), config_.least_in_block, blocks_[i][kTravelX]);
    y.insert(y.end(), config_.least_in_block, blocks_[i][kTravelY]);
  }
  if (x.size() < config_.least_in_block) return std::nullopt;
  return Eigen::Vector3d(MedianOf(x), MedianOf(y), 1).normalized();
}

/// What the newest blocks, from `split` on, changed by, if that is no chance; else 0.
double MountingEstimator::KnockOf(std::size_t which, std::size_t split, const Means& before,
                                  const Means& after) const {
  if (before[which].blocks < config_.knock_least_before ||
      after[which].blocks < config_.knock_blocks) {
    return 0;
  }
  const double difference = after[which].value - before[which].value;
  const double sigma = std::sqrt(before[which].variance + after[which].variance);
  const double least = which == kLogHeight ? config_.knock_height_m / std::exp(before[which].value)
                                           : config_.knock_angle_rad;
  if (!(std::abs(difference) > std::max(least, config_.knock_sigmas * sigma))) return 0;
  // Each of the newest blocks says so by itself.
  for (std::size_t i = split; i < blocks_.size(); ++i) {
    const double one = blocks_[i][which] - before[which].value;
    if (!(one * difference > 0 && std::abs(one) > 0.5 * least)) return 0;
  }
  return difference;
}

/// The newest blocks against all before them. Where the road bends up or down its plane ahead is
/// not the vehicle's: only a knock turns forward and down alike.
void MountingEstimator::NoticeKnock() {
  if (blocks_.size() < config_.knock_least_before + config_.knock_blocks) return;
  const std::size_t split = blocks_.size() - config_.knock_blocks;
  const Means before = MeansOf(0, split, false), after = MeansOf(split, blocks_.size(), false);
  const auto knock = [&](std::size_t which) { return KnockOf(which, split, before, after); };
  const double forward_pitch = -knock(kTravelY), down_pitch = knock(kRoadZ);
  const bool sees_road = after[kRoadZ].blocks >= config_.knock_blocks &&
                         before[kRoadZ].blocks >= config_.knock_least_before;
  const bool pitched = sees_road ? forward_pitch * down_pitch > 0 : forward_pitch != 0;
  const bool knocked =
      pitched || knock(kTravelX) != 0 || knock(kRoadX) != 0 || knock(kLogHeight) != 0;
  if (!knocked) return;
  const std::optional<MountingEstimate> old = EstimateOf(before, {});
  blocks_.erase(blocks_.begin(), blocks_.begin() + static_cast<std::ptrdiff_t>(split));
  const std::optional<MountingEstimate> now = EstimateOf(after, old ? old->mounting : Mounting{});
  if (old && now) knock_ = MountingKnock{old->mounting, now->mounting};
}

std::optional<MountingKnock> MountingEstimator::TakeKnock() {
  std::optional<MountingKnock> knock;
  std::swap(knock, knock_);
  return knock;
}

}  // namespace livemap::odometry
