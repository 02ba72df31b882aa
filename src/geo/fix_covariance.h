#pragma once

#include <Eigen/Core>

namespace livemap::geo {

/// A fix or pose less certain than this, per axis, is none.
constexpr double kMaxFixSigmaM = 1000.0;

/// Whether a matrix from outside can be the covariance of a position in the plane (metres squared):
/// finite, symmetric, positive semidefinite but for rounding, and not above kMaxFixSigmaM.
bool IsFixCovariance(const Eigen::Matrix2d& covariance_m2);

}  // namespace livemap::geo
