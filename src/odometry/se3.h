#pragma once

#include <Eigen/Geometry>

namespace livemap::odometry {

/// Twist of SE(3): translation part first (m), then rotation part (rad).
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// The matrix with [v]x w = v cross w.
Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v);

/// Exponential map of SE(3) in closed form (Rodrigues; series near zero rotation).
Eigen::Isometry3d Se3Exp(const Vector6d& twist);

/// Its inverse, for rotations below pi.
Vector6d Se3Log(const Eigen::Isometry3d& transform);

/// Adjoint: T Exp(xi) T^-1 = Exp(Ad(T) xi).
Matrix6d Se3Adjoint(const Eigen::Isometry3d& transform);

/// The nearest rotation, so that products of thousands of poses stay poses.
Eigen::Isometry3d Renormalised(const Eigen::Isometry3d& transform);

}  // namespace livemap::odometry
