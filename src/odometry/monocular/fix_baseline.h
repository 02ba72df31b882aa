#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <deque>
#include <optional>

#include "geo/vehicle_pose.h"

namespace livemap::odometry {

/// Measures the unit of a monocular map by a receiver's fixes: the straight distance between two
/// fixes against that between the camera's places at their moments. Fixes err by metres, so the two
/// must lie far apart; the way of a standing vehicle tells nothing. Stamps are nanoseconds of one
/// clock. Not thread-safe.
class FixBaseline {
 public:
  struct Config {
    /// A distance is measured as soon as its standard deviation is at most this share of it,
    double enough_sigma = 0.05;
    /// or after so long a time, s,
    double longest_s = 15.0;
    /// when it is at most this share.
    double worst_sigma = 0.2;
    /// How far the antenna and the camera are apart: what turns move them by differently, m.
    double lever_m = 2.0;
    /// Poses further apart in time than this are not interpolated, s.
    double max_gap_s = 0.5;
    /// Of a fix whose receiver states no covariance, standard deviation per axis, m.
    double default_fix_sigma_m = 3.0;
  };
  struct Measurement {
    double metres = 0, sigma_m = 0;
    double units = 0;
  };

  explicit FixBaseline(const Config& config) : config_(config) {}

  /// The camera's pose in units of the map; stamps ascend.
  void AddPose(std::int64_t stamp_ns, const Eigen::Isometry3d& world_from_camera);
  /// A fix, which may come before the pose of its moment or after it. One that is no plausible fix
  /// (geo::IsPlausible), or not later than the last one, is passed over.
  void AddFix(const geo::Fix& fix);
  /// The next distance that is sure enough; none where there is none yet.
  std::optional<Measurement> Measure();
  /// What the poses so far have as 1 is `factor` in the unit of those to come.
  void Stretch(double factor);
  /// The map or the path is another one now.
  void Reset();

 private:
  struct Pose {
    std::int64_t stamp_ns;
    Eigen::Isometry3d world_from_camera;
  };
  struct Anchor {
    geo::Fix fix;
    Eigen::Isometry3d world_from_camera;
  };

  std::optional<Eigen::Isometry3d> PoseAt(std::int64_t stamp_ns) const;
  Measurement Compare(const Anchor& from, const Anchor& to) const;

  Config config_;
  std::deque<Pose> poses_;      // Of the last seconds.
  std::deque<geo::Fix> fixes_;  // That wait for the pose of their moment.
  std::optional<Anchor> anchor_;
};

}  // namespace livemap::odometry
