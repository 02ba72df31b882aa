#include "odometry/edge/seen_movements.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace livemap::odometry {
namespace {

constexpr double kMostNoise = 0.5;

}  // namespace

SeenMovements::SeenMovements(const Matrix6d& information, const Matrix6d& noise_information) {
  if (!information.allFinite() || !noise_information.allFinite()) return;
  const Eigen::LLT<Matrix6d> factors(information);
  if (factors.info() != Eigen::Success) return;
  const Matrix6d half = factors.matrixL().solve(noise_information);
  const Matrix6d relative = factors.matrixL().solve(half.transpose());
  const Eigen::SelfAdjointEigenSolver<Matrix6d> shares(0.5 * (relative + relative.transpose()));
  noise_shares_ = shares.eigenvalues();
  twist_from_coordinates_ = factors.matrixU().solve(shares.eigenvectors());
  coordinates_from_twist_ = shares.eigenvectors().transpose() * Matrix6d(factors.matrixU());
  is_known_ = true;
}

bool SeenMovements::All() const { return !is_known_ || noise_shares_.maxCoeff() < kMostNoise; }

Vector6d SeenMovements::IsSeen() const {
  return (noise_shares_.array() < kMostNoise).cast<double>();
}

Vector6d SeenMovements::Told(const Vector6d& step) const {
  return twist_from_coordinates_ * IsSeen().cwiseProduct(coordinates_from_twist_ * step);
}

Matrix6d SeenMovements::Widened(const Matrix6d& covariance, double unseen_variance) const {
  if (!is_known_) return covariance;
  const Vector6d seen = IsSeen();
  const Matrix6d widening = twist_from_coordinates_ * seen.asDiagonal() * coordinates_from_twist_;
  Matrix6d widened = widening * covariance * widening.transpose();
  for (int i = 0; i < 6; ++i) {
    if (seen[i] > 0) continue;
    const Vector6d direction = twist_from_coordinates_.col(i).normalized();
    widened += unseen_variance * direction * direction.transpose();
  }
  return widened;
}

}  // namespace livemap::odometry
