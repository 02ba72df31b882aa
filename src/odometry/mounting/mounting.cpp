#include "odometry/mounting/mounting.h"

#include <algorithm>
#include <cmath>

namespace livemap::odometry {
namespace {

/// The optical frame in camera_link (x forward along the view, y left, z up): REP 103.
Eigen::Matrix3d CameraLinkFromOptical() {
  Eigen::Matrix3d rotation;
  rotation << 0, 0, 1,  //
      -1, 0, 0,         //
      0, -1, 0;
  return rotation;
}

}  // namespace

Eigen::Matrix3d BaseFromOpticalRotation(const Mounting& mounting) {
  const Eigen::Matrix3d base_from_link =
      (Eigen::AngleAxisd(mounting.yaw_rad, Eigen::Vector3d::UnitZ()) *
       Eigen::AngleAxisd(mounting.pitch_rad, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(mounting.roll_rad, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return base_from_link * CameraLinkFromOptical();
}

Mounting MountingOfRotation(const Eigen::Matrix3d& base_from_optical) {
  const Eigen::Matrix3d link = base_from_optical * CameraLinkFromOptical().transpose();
  Mounting mounting;
  mounting.yaw_rad = std::atan2(link(1, 0), link(0, 0));
  mounting.pitch_rad = std::asin(std::clamp(-link(2, 0), -1.0, 1.0));
  mounting.roll_rad = std::atan2(link(2, 1), link(2, 2));
  return mounting;
}

VehicleAxes AxesInCamera(const Mounting& mounting) {
  const Eigen::Matrix3d optical_from_base = BaseFromOpticalRotation(mounting).transpose();
  return {optical_from_base.col(0), -optical_from_base.col(2)};
}

Mounting MountingOfAxes(const VehicleAxes& axes) {
  Eigen::Matrix3d base_from_optical;
  base_from_optical.row(0) = axes.forward;
  base_from_optical.row(1) = axes.forward.cross(axes.down);
  base_from_optical.row(2) = -axes.down;
  return MountingOfRotation(base_from_optical);
}

}  // namespace livemap::odometry
