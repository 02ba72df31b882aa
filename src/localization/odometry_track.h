#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "localization/localizer_config.h"
#include "localization/planar.h"

namespace livemap::localization {

/// How the odometry moved between two moments, in the vehicle's frame at the first of them.
struct PlanarMotion {
  double time_s = 0;
  Eigen::Vector2d way_m = Eigen::Vector2d::Zero();
  double turn_rad = 0;
  /// Derivative of way_m by a bias of the yaw rate, m/(rad/s).
  Eigen::Vector2d way_per_bias = Eigen::Vector2d::Zero();
  /// Of (way_m, turn_rad).
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// The recent odometry of one vehicle as one continuous track: a reset of the odometry (a jump back
/// to the origin, a lost map) is bridged by the last speed with an honest covariance. When steps
/// that agree with each other contradict that speed, it was the speed that was wrong. Not
/// thread-safe.
class OdometryTrack {
 public:
  enum class Verdict {
    kAccepted,
    kReset,       ///< Accepted; the odometry jumped, the track goes on by the last speed.
    kInvalid,     ///< NaN, no pose, or a covariance that is none.
    kOutOfOrder,  ///< Not newer than the newest.
  };

  OdometryTrack(const OdometryModel& model, double max_extrapolation_s);

  /// `increment_covariance`: of the motion since the last pose, (x forward, y left, yaw) in the
  /// vehicle's frame; without one the model's noise is taken.
  Verdict Add(std::int64_t stamp_ns, const Eigen::Isometry3d& odom_from_base,
              const std::optional<Eigen::Matrix3d>& increment_covariance);
  /// The odometry is lost: its pose says nothing about the motion since the last one, which is
  /// bridged as a reset is. The pose counts as where a later Add goes on from.
  Verdict AddLost(std::int64_t stamp_ns, const Eigen::Isometry3d& odom_from_base);

  bool empty() const { return samples_.empty(); }
  std::int64_t oldest_ns() const { return samples_.front().stamp_ns; }
  std::int64_t newest_ns() const { return samples_.back().stamp_ns; }
  /// As the odometry gave it, also while it was lost.
  const PlanarPose& newest_raw() const { return newest_raw_; }
  /// Whether the track has (or may carry on to) this moment.
  bool Covers(std::int64_t stamp_ns) const;

  /// Pose in the track's own frame at a covered moment.
  PlanarPose At(std::int64_t stamp_ns) const;
  /// Velocity in the track's own frame around a covered moment, m/s.
  Eigen::Vector2d VelocityAt(std::int64_t stamp_ns) const;
  /// Motion between two covered moments, `from_ns` <= `to_ns`.
  PlanarMotion Between(std::int64_t from_ns, std::int64_t to_ns) const;
  /// The same in either direction without covariance, for moments close to each other.
  PlanarMotion Nearby(std::int64_t from_ns, std::int64_t to_ns) const;

  void ForgetBefore(std::int64_t stamp_ns);
  void Clear();

 private:
  struct Sample {
    std::int64_t stamp_ns;
    PlanarPose pose;             // In the track's frame.
    Eigen::Matrix3d covariance;  // Of the step from the sample before.
  };

  std::optional<Verdict> Refuse(std::int64_t stamp_ns, const Eigen::Isometry3d& odom_from_base);
  void Coast(std::int64_t stamp_ns);
  std::size_t After(std::int64_t stamp_ns) const;
  /// How the odometry moves, in the vehicle's frame.
  struct Speed {
    Eigen::Vector2d way_mps = Eigen::Vector2d::Zero();
    double yaw_rps = 0;
  };

  bool IsPossible(const PlanarPose& step, double time_s) const;
  bool Continues(const Speed& speed, const PlanarPose& step, double time_s) const;
  bool IsJump(const PlanarPose& step, double time_s);
  Eigen::Matrix3d StepCovariance(const PlanarPose& step, double time_s) const;
  Eigen::Matrix3d CoastCovariance(double time_s) const;

  const OdometryModel model_;
  const double max_extrapolation_s_;
  std::deque<Sample> samples_;  // Ascending stamps.
  PlanarPose newest_raw_;
  Speed speed_;  // The last.
  bool moving_known_ = false;
  Speed other_speed_;    // That of the steps which contradict the last one...
  int other_steps_ = 0;  // ...so many in succession.
};

}  // namespace livemap::localization
