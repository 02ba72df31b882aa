#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>

#include "odometry/edge/edge_odometry.h"
#include "simulation/room/patterned_wall.h"

namespace livemap::odometry {

/// Looks at the wall in most tests.
inline constexpr geo::CameraIntrinsics kWallCamera{260, 260, 159.5, 119.5, 320, 240};

/// The simulator's patterned wall as frames for odometry.
class SyntheticWall {
 public:
  explicit SyntheticWall(const geo::CameraIntrinsics& camera) : camera_(camera) {}

  RgbdFrame See(std::int64_t stamp_ns, const Eigen::Isometry3d& world_from_camera, double gain = 1,
                double bias = 0) const {
    const simulation::PatternedWall::View view =
        simulation::PatternedWall::See(camera_, world_from_camera, gain, bias);
    RgbdFrame frame;
    frame.stamp_ns = stamp_ns;
    frame.grey = view.grey;
    frame.depth = view.depth;
    return frame;
  }

 private:
  geo::CameraIntrinsics camera_;
};

inline Eigen::Isometry3d Pose(double x, double y, double z, double roll, double pitch, double yaw) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(x, y, z);
  pose.linear() = (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  return pose;
}

}  // namespace livemap::odometry
