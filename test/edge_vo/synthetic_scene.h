#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>

#include "edge_vo/edge_odometry.h"

namespace livemap {

/// A wall with a smooth pattern of patches, 2 m before the origin and slanted, seen by a camera
/// that moves: image and depth are exact.
class SyntheticWall {
 public:
  explicit SyntheticWall(const CameraIntrinsics& camera) : camera_(camera) {}

  RgbdFrame See(std::int64_t stamp_ns, const Eigen::Isometry3d& world_from_camera, double gain = 1,
                double bias = 0) const {
    RgbdFrame frame;
    frame.stamp_ns = stamp_ns;
    frame.grey.create(camera_.height, camera_.width, CV_8UC1);
    frame.depth.create(camera_.height, camera_.width, CV_32FC1);
    const Eigen::Vector3d normal(0.15, 0.1, 1);  // normal . p = 2 on the wall.
    for (int y = 0; y < camera_.height; ++y) {
      for (int x = 0; x < camera_.width; ++x) {
        const Eigen::Vector3d ray =
            world_from_camera.linear() *
            Eigen::Vector3d((x - camera_.cx) / camera_.fx, (y - camera_.cy) / camera_.fy, 1);
        const double distance = (2 - normal.dot(world_from_camera.translation())) / normal.dot(ray);
        const Eigen::Vector3d point = world_from_camera.translation() + distance * ray;
        frame.depth.at<float>(y, x) = static_cast<float>(distance);
        frame.grey.at<std::uint8_t>(y, x) =
            cv::saturate_cast<std::uint8_t>(gain * Pattern(point.x(), point.y()) + bias);
      }
    }
    return frame;
  }

 private:
  /// Grey value of the wall: patches with edges about a centimetre wide, no two alike.
  static double Pattern(double x, double y) {
    const double patches = std::tanh(6 * std::sin(9 * x + 3 * std::sin(4 * y))) +
                           std::tanh(6 * std::sin(8 * y + 2 * std::sin(5 * x)));
    return 128 + 38 * patches + 12 * std::sin(23 * x + 17 * y);
  }

  CameraIntrinsics camera_;
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

}  // namespace livemap
