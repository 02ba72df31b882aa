#pragma once

#include <algorithm>
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

/// The depth that a camera measures of the corner of two walls with the floor.
inline cv::Mat DepthOfCorner(const Eigen::Isometry3d& world_from_camera) {
  cv::Mat depth(kWallCamera.height, kWallCamera.width, CV_32FC1);
  const Eigen::Vector3d walls(1, 0.8, 3);  // x, y and z of the wall that faces along it.
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const Eigen::Vector3d ray =
          world_from_camera.linear() * Eigen::Vector3d((u - kWallCamera.cx) / kWallCamera.fx,
                                                       (v - kWallCamera.cy) / kWallCamera.fy, 1);
      double nearest = std::numeric_limits<double>::infinity();
      for (int i = 0; i < 3; ++i) {
        if (ray[i] > 0) {
          nearest = std::min(nearest, (walls[i] - world_from_camera.translation()[i]) / ray[i]);
        }
      }
      depth.at<float>(v, u) = static_cast<float>(nearest);
    }
  }
  return depth;
}

}  // namespace livemap::odometry
