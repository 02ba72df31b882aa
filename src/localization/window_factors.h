#pragma once

#include <ceres/ceres.h>

#include <Eigen/Core>
#include <cmath>

#include "localization/fix_measurement.h"
#include "localization/odometry_track.h"

namespace livemap::localization {

/// Of the vehicle at one moment: east, north (m), yaw from east to north (rad), and the receiver's
/// shared error, east and north, in units of its standard deviation.
constexpr int kNodeSize = 5;
/// Of the whole window: the receiver's latency (s), true over reported way less 1, bias of the yaw
/// rate (rad/s).
constexpr int kCalibrationSize = 3;
/// A node and the calibration.
constexpr int kStateSize = kNodeSize + kCalibrationSize;

using NodeState = Eigen::Matrix<double, kNodeSize, 1>;
using Calibration = Eigen::Matrix<double, kCalibrationSize, 1>;
using StateVector = Eigen::Matrix<double, kStateSize, 1>;
using StateMatrix = Eigen::Matrix<double, kStateSize, kStateSize>;

template <typename T>
using Vector2T = Eigen::Matrix<T, 2, 1>;

template <typename T>
Vector2T<T> Rotated(const T& angle_rad, const Vector2T<T>& vector) {
  using std::cos;
  using std::sin;
  return {cos(angle_rad) * vector.x() - sin(angle_rad) * vector.y(),
          sin(angle_rad) * vector.x() + cos(angle_rad) * vector.y()};
}

/// The same angle to [-pi, pi); the derivative is 1.
template <typename T>
T Wrapped(const T& angle_rad) {
  using std::floor;
  constexpr double kTwoPi = 6.28318530717958647693;
  return angle_rad - kTwoPi * floor(angle_rad / kTwoPi + 0.5);
}

/// Equation (2) of docs/explanation/localization.md: the place where a fix should lie.
struct FixFactor {
  const FixMeasurement* fix;
  Eigen::Vector2d antenna_m;

  template <typename T>
  bool operator()(const T* node, const T* calibration, T* residual) const {
    const PlanarMotion& motion = fix->motion;
    const Vector2T<T> way =
        (motion.way_m.cast<T>() + motion.way_per_bias.cast<T>() * calibration[2] +
         fix->velocity_mps.cast<T>() * (fix->latency_s - calibration[0])) *
        (1.0 + calibration[1]);
    const T yaw = node[2] + motion.turn_rad - calibration[2] * motion.time_s;
    const Vector2T<T> foretold = Vector2T<T>(node[0], node[1]) + Rotated<T>(node[2], way) +
                                 Rotated<T>(yaw, antenna_m.cast<T>()) +
                                 Vector2T<T>(node[3], node[4]) * T(fix->shared_m);
    Eigen::Map<Vector2T<T>>{residual} =
        (fix->root_information / fix->widening).cast<T>() * (fix->place_m.cast<T>() - foretold);
    return true;
  }
};
using FixCost = ceres::AutoDiffCostFunction<FixFactor, 2, kNodeSize, kCalibrationSize>;

/// Equations (3) and (4): odometry and the wandering of the shared error between two nodes.
struct LinkFactor {
  PlanarMotion motion;
  Eigen::Matrix3d root_information;
  double keep;    ///< Share of the shared error that stays.
  double wander;  ///< Standard deviation of what is new in it.

  LinkFactor(const PlanarMotion& between, double shared_time_s) : motion(between) {
    root_information = between.covariance.inverse().llt().matrixU();
    keep = std::exp(-between.time_s / shared_time_s);
    wander = std::sqrt(1 - keep * keep + 1e-9);
  }

  template <typename T>
  bool operator()(const T* from, const T* to, const T* calibration, T* residual) const {
    const Vector2T<T> way =
        (motion.way_m.cast<T>() + motion.way_per_bias.cast<T>() * calibration[2]) *
        (1.0 + calibration[1]);
    const Vector2T<T> apart(to[0] - from[0], to[1] - from[1]);
    Eigen::Matrix<T, 3, 1> error;
    error.template head<2>() = Rotated<T>(-from[2], apart) - way;
    error[2] = Wrapped<T>(to[2] - from[2] - motion.turn_rad + calibration[2] * motion.time_s);
    Eigen::Map<Eigen::Matrix<T, 3, 1>>{residual} = root_information.cast<T>() * error;
    residual[3] = (to[3] - keep * from[3]) / wander;
    residual[4] = (to[4] - keep * from[4]) / wander;
    return true;
  }
};
using LinkCost = ceres::AutoDiffCostFunction<LinkFactor, 5, kNodeSize, kNodeSize, kCalibrationSize>;

/// Equation (5): what is known of the oldest node and of the calibration without the window's
/// fixes.
struct PriorFactor {
  const StateVector* mean;
  const StateMatrix* root_information;

  template <typename T>
  bool operator()(const T* node, const T* calibration, T* residual) const {
    Eigen::Matrix<T, kStateSize, 1> error;
    for (int i = 0; i < kNodeSize; ++i) error[i] = node[i] - (*mean)[i];
    for (int i = 0; i < kCalibrationSize; ++i) {
      error[kNodeSize + i] = calibration[i] - (*mean)[kNodeSize + i];
    }
    error[2] = Wrapped<T>(error[2]);
    Eigen::Map<Eigen::Matrix<T, kStateSize, 1>>{residual} = root_information->cast<T>() * error;
    return true;
  }
};
using PriorCost = ceres::AutoDiffCostFunction<PriorFactor, kStateSize, kNodeSize, kCalibrationSize>;

}  // namespace livemap::localization
