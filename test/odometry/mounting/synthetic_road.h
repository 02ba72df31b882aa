#pragma once

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>

#include "geo/camera_intrinsics.h"
#include "odometry/mounting/mounting.h"

namespace livemap::odometry {

inline constexpr geo::CameraIntrinsics kRoadEye{260, 260, 159.5, 119.5, 320, 240};

/// A camera over an endless level road whose grey value is a formula of the place; nothing else is
/// in the world, whose axes are those of base_link at its start.
class SyntheticRoad {
 public:
  explicit SyntheticRoad(const Mounting& mounting) : mounting_(mounting) {}

  Eigen::Isometry3d WorldFromCamera(double x, double y = 0, double heading = 0) const {
    Eigen::Isometry3d base = Eigen::Isometry3d::Identity();
    base.translation() = Eigen::Vector3d(x, y, 0);
    base.linear() = Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();
    camera.translation() = Eigen::Vector3d(1.5, 0, mounting_.height_m);
    camera.linear() = BaseFromOpticalRotation(mounting_);
    return base * camera;
  }

  /// Depth in m along the optical axis goes to `depth_m`, 0 above the horizon.
  cv::Mat See(const Eigen::Isometry3d& world_from_camera, cv::Mat* depth_m = nullptr) const {
    cv::Mat grey(kRoadEye.height, kRoadEye.width, CV_8UC1, cv::Scalar(200));
    cv::Mat depth(grey.size(), CV_32FC1, cv::Scalar(0));
    for (int v = 0; v < grey.rows; ++v) {
      for (int u = 0; u < grey.cols; ++u) {
        const Eigen::Vector3d ray((u - kRoadEye.cx) / kRoadEye.fx, (v - kRoadEye.cy) / kRoadEye.fy,
                                  1);
        const Eigen::Vector3d along = world_from_camera.linear() * ray;
        if (along.z() > -0.03) continue;
        const double stretch = -world_from_camera.translation().z() / along.z();
        const Eigen::Vector3d place = world_from_camera.translation() + stretch * along;
        grey.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(std::lround(Grey(place)));
        depth.at<float>(v, u) = static_cast<float>(stretch);
      }
    }
    if (depth_m != nullptr) *depth_m = depth;
    return grey;
  }

 private:
  static double Grey(const Eigen::Vector3d& place) {
    const double x = place.x(), y = place.y();
    return 120 + 18 * std::sin(4.1 * x + 1.3 * y) + 15 * std::sin(2.3 * x - 3.7 * y + 1) +
           14 * std::sin(1.1 * x + 5.9 * y + 2) + 12 * std::sin(6.3 * x + 0.4 * y + 0.5);
  }

  Mounting mounting_;
};

inline double Radians(double degrees) { return degrees * M_PI / 180; }

}  // namespace livemap::odometry
