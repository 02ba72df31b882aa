#include "odometry/se3.h"

#include <cmath>

namespace livemap::odometry {
namespace {

constexpr double kSmallAngleRad = 1e-4;  // Below it the series' first omitted term is under 1e-17.

/// sin(a)/a, (1 - cos(a))/a^2 and (a - sin(a))/a^3.
struct AngleSeries {
  explicit AngleSeries(double angle) {
    const double square = angle * angle;
    if (angle < kSmallAngleRad) {
      first = 1 - square / 6;
      second = 0.5 - square / 24;
      third = 1.0 / 6 - square / 120;
    } else {
      first = std::sin(angle) / angle;
      second = (1 - std::cos(angle)) / square;
      third = (angle - std::sin(angle)) / (square * angle);
    }
  }
  double first, second, third;
};

}  // namespace

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

Eigen::Isometry3d Se3Exp(const Vector6d& twist) {
  const Eigen::Vector3d rotation = twist.tail<3>();
  const AngleSeries series(rotation.norm());
  const Eigen::Matrix3d cross = CrossMatrix(rotation);
  const Eigen::Matrix3d square = cross * cross;
  Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
  transform.linear() += series.first * cross + series.second * square;
  transform.translation() =
      twist.head<3>() + (series.second * cross + series.third * square) * twist.head<3>();
  return transform;
}

Vector6d Se3Log(const Eigen::Isometry3d& transform) {
  const Eigen::AngleAxisd angle_axis(Eigen::Quaterniond(transform.linear()).normalized());
  const Eigen::Vector3d rotation = angle_axis.angle() * angle_axis.axis();
  const Eigen::Matrix3d cross = CrossMatrix(rotation);
  const AngleSeries series(angle_axis.angle());
  const Eigen::Matrix3d left_jacobian =
      Eigen::Matrix3d::Identity() + series.second * cross + series.third * cross * cross;
  Vector6d twist;
  twist << left_jacobian.inverse() * transform.translation(), rotation;
  return twist;
}

Matrix6d Se3Adjoint(const Eigen::Isometry3d& transform) {
  const Eigen::Matrix3d rotation = transform.linear();
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = rotation;
  adjoint.topRightCorner<3, 3>() = CrossMatrix(transform.translation()) * rotation;
  adjoint.bottomRightCorner<3, 3>() = rotation;
  return adjoint;
}

Eigen::Isometry3d Renormalised(const Eigen::Isometry3d& transform) {
  Eigen::Isometry3d result = transform;
  result.linear() = Eigen::Quaterniond(transform.linear()).normalized().toRotationMatrix();
  return result;
}

}  // namespace livemap::odometry
