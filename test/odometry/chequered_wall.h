#pragma once

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <random>

#include "test/odometry/synthetic_scene.h"

namespace livemap::odometry {

/// A wall of checks in the plane z = 2 m, of which each has a shade of its own: edges say the same
/// in each period, shades do not.
class ChequeredWall {
 public:
  static constexpr double kSideM = 0.3;

  /// `unlikeness`: by up to how many grey levels a check's shade differs from its kind's.
  explicit ChequeredWall(double unlikeness) : unlikeness_(unlikeness) {}

  RgbdFrame See(std::int64_t stamp_ns, const Eigen::Isometry3d& world_from_camera, double gain = 1,
                double bias = 0) const {
    RgbdFrame frame;
    frame.stamp_ns = stamp_ns;
    frame.grey.create(kWallCamera.height, kWallCamera.width, CV_8UC1);
    frame.depth.create(kWallCamera.height, kWallCamera.width, CV_32FC1);
    for (int v = 0; v < frame.grey.rows; ++v) {
      for (int u = 0; u < frame.grey.cols; ++u) {
        const Eigen::Vector3d ray =
            world_from_camera.linear() * Eigen::Vector3d((u - kWallCamera.cx) / kWallCamera.fx,
                                                         (v - kWallCamera.cy) / kWallCamera.fy, 1);
        const double distance = (2 - world_from_camera.translation().z()) / ray.z();
        const Eigen::Vector3d place = world_from_camera.translation() + distance * ray;
        frame.depth.at<float>(v, u) = static_cast<float>(distance);
        frame.grey.at<std::uint8_t>(v, u) =
            cv::saturate_cast<std::uint8_t>(gain * ShadeAt(place.x(), place.y()) + bias);
      }
    }
    return frame;
  }

 private:
  double ShadeAt(double x, double y) const {
    const auto column = static_cast<int>(std::floor(x / kSideM));
    const auto row = static_cast<int>(std::floor(y / kSideM));
    std::minstd_rand random(static_cast<unsigned>(7919 * (column + 1000) + 104729 * (row + 1000)));
    random.discard(3);
    const double own = std::uniform_real_distribution<double>(-1, 1)(random);
    return (((column + row) & 1) == 0 ? 80 : 160) + unlikeness_ * own;
  }

  double unlikeness_;
};

}  // namespace livemap::odometry
