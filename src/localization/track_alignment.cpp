#include "localization/track_alignment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/median.h"

namespace livemap::localization {
namespace {

constexpr std::size_t kTriedEnds = 24;  // Pairs of so many evenly chosen places are tried.

double AlignmentDoubt(const TrackPair& pair, const PlanarPose& pose) {
  const Eigen::Vector2d error_m =
      pair.map_m - pose.position_m - Rotation2(pose.yaw_rad) * pair.track_m;
  return error_m.squaredNorm() / (pair.sigma_m * pair.sigma_m);
}

/// The pose that brings one pair together and turns the line to another into its direction.
PlanarPose AlignmentThroughTwo(const TrackPair& a, const TrackPair& b) {
  const Eigen::Vector2d track_m = b.track_m - a.track_m;
  const Eigen::Vector2d map_m = b.map_m - a.map_m;
  PlanarPose pose;
  pose.yaw_rad = WrapAngle(std::atan2(map_m.y(), map_m.x()) - std::atan2(track_m.y(), track_m.x()));
  const Eigen::Vector2d track_middle_m = 0.5 * (a.track_m + b.track_m);
  pose.position_m = 0.5 * (a.map_m + b.map_m) - Rotation2(pose.yaw_rad) * track_middle_m;
  return pose;
}

double MedianAlignmentDoubt(const std::vector<TrackPair>& pairs, const PlanarPose& pose,
                            std::vector<double>& doubts) {
  doubts.clear();
  for (const TrackPair& pair : pairs) doubts.push_back(AlignmentDoubt(pair, pose));
  return TakeMedian(doubts);
}

/// Least squares over the pairs that agree; false when they all lie in one place.
bool RefineAlignment(const std::vector<TrackPair>& pairs, TrackAlignment& alignment) {
  double weights = 0;
  Eigen::Vector2d track_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d map_m = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!alignment.agrees[i]) continue;
    const double weight = 1 / (pairs[i].sigma_m * pairs[i].sigma_m);
    weights += weight;
    track_m += weight * pairs[i].track_m;
    map_m += weight * pairs[i].map_m;
  }
  track_m /= weights;
  map_m /= weights;
  double along = 0, across = 0, spread = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!alignment.agrees[i]) continue;
    const double weight = 1 / (pairs[i].sigma_m * pairs[i].sigma_m);
    const Eigen::Vector2d a = pairs[i].track_m - track_m;
    const Eigen::Vector2d b = pairs[i].map_m - map_m;
    along += weight * a.dot(b);
    across += weight * (a.x() * b.y() - a.y() * b.x());
    spread += weight * a.squaredNorm();
  }
  if (spread <= 0) return false;
  PlanarPose& pose = alignment.map_from_track;
  pose.yaw_rad = std::atan2(across, along);
  pose.position_m = map_m - Rotation2(pose.yaw_rad) * track_m;
  alignment.yaw_sigma_rad = alignment.widening / std::sqrt(spread);
  return true;
}

}  // namespace

double Widening(std::vector<double> squared_distances) {
  constexpr double kMedian = 1.386;  // Of chi-square with two degrees of freedom: 2 ln 2.
  constexpr double kMost = 20;
  if (squared_distances.empty()) return 1;
  return std::clamp(std::sqrt(TakeMedian(squared_distances) / kMedian), 1.0, kMost);
}

std::optional<TrackAlignment> AlignTrack(const std::vector<TrackPair>& pairs, double gate,
                                         std::size_t min_pairs) {
  if (pairs.size() < std::max<std::size_t>(min_pairs, 2)) return std::nullopt;
  TrackAlignment best;
  double least_doubt = std::numeric_limits<double>::infinity();
  std::vector<double> doubts;
  const std::size_t tried = std::min(pairs.size(), kTriedEnds);
  const auto chosen = [&](std::size_t i) { return pairs[i * (pairs.size() - 1) / (tried - 1)]; };
  for (std::size_t i = 0; i < tried; ++i) {
    for (std::size_t j = i + 1; j < tried; ++j) {
      const PlanarPose pose = AlignmentThroughTwo(chosen(i), chosen(j));
      const double doubt = MedianAlignmentDoubt(pairs, pose, doubts);
      if (doubt >= least_doubt) continue;
      least_doubt = doubt;
      best.map_from_track = pose;
    }
  }
  // Twice: the second time with the pairs that agree with the better pose.
  for (int round = 0; round < 2; ++round) {
    MedianAlignmentDoubt(pairs, best.map_from_track, doubts);
    best.widening = Widening(doubts);
    best.agrees.assign(pairs.size(), false);
    std::size_t agreeing = 0;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      best.agrees[i] =
          AlignmentDoubt(pairs[i], best.map_from_track) <= gate * best.widening * best.widening;
      agreeing += best.agrees[i] ? 1 : 0;
    }
    if (agreeing < min_pairs || 2 * agreeing <= pairs.size()) return std::nullopt;
    if (!RefineAlignment(pairs, best)) return std::nullopt;
  }
  return best;
}

}  // namespace livemap::localization
