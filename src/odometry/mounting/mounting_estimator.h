#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "odometry/mounting/mounting.h"
#include "odometry/mounting/road_plane.h"

namespace livemap::odometry {

/// A mounting with standard deviations, which are infinite for what is not known yet.
struct MountingEstimate {
  Mounting mounting;
  Mounting sigma;
  bool height_known = false;
  bool roll_known = false;
};

/// What a camera that was knocked turned or moved by.
struct MountingKnock {
  Mounting before, after;
};

/// Estimates how the camera is mounted from what it sees of the vehicle's motion: forward is where
/// the vehicle drives while it drives straight, down is the normal of the road. Both wander by the
/// body's springs, the lane and the odometry's slow errors, so measurements are gathered in blocks
/// of some metres, each of which counts as one, and what the blocks scatter by is the standard
/// deviation. Not thread-safe; memory and time per call are bounded.
class MountingEstimator {
 public:
  struct Config {
    /// Length of a block, m of travel.
    double block_m = 15;
    /// The least number of measurements of one kind that make a block's mean.
    std::size_t least_in_block = 4;
    /// Blocks that are kept: older ones are forgotten.
    std::size_t blocks_kept = 400;
    /// Nothing is stated before so many blocks.
    std::size_t least_blocks = 3;
    /// Of what no scatter shows: the body's mean lean, the calibration's errors.
    double angle_floor_rad = 0.0006;
    double height_floor = 0.004;  ///< Share of the height.
    /// Errors of the metres are shared by so many blocks.
    double blocks_per_metres_error = 4;
    /// The scatter of few blocks is known badly: as if so many had been seen with these.
    double prior_blocks = 3;
    double prior_angle_rad = 0.004;
    double prior_height = 0.02;  ///< Share of the height.
    /// The camera was knocked when so many blocks in a row lie, on average, so many standard
    /// deviations beside all earlier ones, and by at least so much.
    std::size_t knock_blocks = 3;
    double knock_sigmas = 5;
    double knock_angle_rad = 0.009;
    double knock_height_m = 0.1;
    /// Blocks before that tell what was usual.
    std::size_t knock_least_before = 6;
  };

  explicit MountingEstimator(const Config& config) : config_(config) {}

  /// The vehicle drove straight for `way_m` metres, in this direction of the camera's optical
  /// frame. Ignored unless finite, and ahead of the camera.
  void AddTravel(const Eigen::Vector3d& direction, double way_m);

  /// The road as the camera sees it. `metres_sigma` is that of the distance's metres, a share of
  /// them; infinite: only the direction is known. Ignored unless finite, and below the camera.
  void AddRoad(const RoadPlane& road, double metres_sigma);

  /// The mounting, once a few blocks are full. Without a road the roll and the height are those of
  /// `otherwise`, with infinite standard deviations.
  std::optional<MountingEstimate> Estimate(const Mounting& otherwise) const;

  /// The estimate of the newest blocks alone, for what has to follow at once.
  std::optional<Eigen::Vector3d> TravelSoFar() const;

  /// Told once per knock. What was learnt before it is forgotten.
  std::optional<MountingKnock> TakeKnock();

  std::size_t blocks() const { return blocks_.size(); }

 private:
  /// Slopes of the direction of travel (x/z, y/z) and of the road's normal (x/y, z/y), and the
  /// logarithm of the height with the standard deviation of its metres; each NaN where it was not
  /// measured.
  enum { kTravelX, kTravelY, kRoadX, kRoadZ, kLogHeight, kMetresSigma, kMeasured };
  using Values = std::array<double, kMeasured>;
  struct Mean {
    double value = 0;
    double variance = 0;  ///< Of the mean.
    std::size_t blocks = 0;
  };
  using Means = std::array<Mean, kMeasured>;

  void CloseBlock();
  Mean MeanOf(int which, std::size_t begin, std::size_t end, bool floors) const;
  Means MeansOf(std::size_t begin, std::size_t end, bool floors) const;
  std::optional<MountingEstimate> EstimateOf(const Means& means, const Mounting& otherwise) const;
  void NoticeKnock();
  double KnockOf(std::size_t which, std::size_t split, const Means& before,
                 const Means& after) const;

  Config config_;
  std::array<std::vector<double>, kMeasured> open_;  ///< Of the block that is being filled.
  double open_way_m_ = 0;
  std::deque<Values> blocks_;
  std::optional<MountingKnock> knock_;
};

}  // namespace livemap::odometry
