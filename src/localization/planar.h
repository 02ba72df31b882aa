#pragma once

#include <Eigen/Core>
#include <cmath>

namespace livemap::localization {

/// To [-pi, pi).
inline double WrapAngle(double angle_rad) {
  constexpr double kTwoPi = 6.28318530717958647693;
  return angle_rad - kTwoPi * std::floor(angle_rad / kTwoPi + 0.5);
}

inline Eigen::Matrix2d Rotation2(double angle_rad) {
  Eigen::Matrix2d rotation;
  rotation << std::cos(angle_rad), -std::sin(angle_rad), std::sin(angle_rad), std::cos(angle_rad);
  return rotation;
}

/// A quarter turn to the left.
inline Eigen::Vector2d TurnedLeft(const Eigen::Vector2d& vector) {
  return {-vector.y(), vector.x()};
}

/// A pose in a plane; the yaw is counted from x to y.
struct PlanarPose {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double yaw_rad = 0;

  PlanarPose operator*(const PlanarPose& then) const {
    return {position_m + Rotation2(yaw_rad) * then.position_m, yaw_rad + then.yaw_rad};
  }
  PlanarPose Inverse() const { return {-(Rotation2(-yaw_rad) * position_m), -yaw_rad}; }
};

}  // namespace livemap::localization
