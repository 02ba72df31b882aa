#include "odometry/edge/seen_movements.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace livemap::odometry {
namespace {

constexpr double kMostNoise = 0.5;
/// A variance above this is nobody's error but that of a movement that is not seen.
constexpr double kMostSeenVariance = 0.01 * kUnseenVariance;
/// A camera turns by two radians as easily as it moves by a metre.
constexpr double kMetresPerRadian = 0.5;

}  // namespace

Vector6d UnseenPart(const Vector6d& difference, const Matrix6d& covariance) {
  if (!covariance.allFinite()) return Vector6d::Zero();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> known(covariance);
  Vector6d metres = Vector6d::Ones();
  metres.tail<3>().setConstant(kMetresPerRadian);
  // Eigenvalues are in rising order, so that the last columns are unseen. The shortest change of
  // the pose is looked for, with turns in metres.
  const auto unseen = (known.eigenvalues().array() > kMostSeenVariance).count();
  if (unseen == 0) return Vector6d::Zero();
  const Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6> directions =
      metres.asDiagonal() * known.eigenvectors().rightCols(unseen);
  const Vector6d along =
      directions * directions.colPivHouseholderQr().solve(metres.cwiseProduct(difference));
  return along.cwiseQuotient(metres);
}

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

Matrix6d SeenMovements::Widened(const Matrix6d& covariance) const {
  if (!is_known_) return covariance;
  const Vector6d seen = IsSeen();
  const Matrix6d widening = twist_from_coordinates_ * seen.asDiagonal() * coordinates_from_twist_;
  Matrix6d widened = widening * covariance * widening.transpose();
  // The directions may be all but parallel; all that they span is unseen.
  Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6> unseen(6, 6);
  Eigen::Index count = 0;
  for (int i = 0; i < 6; ++i) {
    if (seen[i] == 0) unseen.col(count++) = twist_from_coordinates_.col(i).normalized();
  }
  if (count == 0) return widened;
  unseen.conservativeResize(6, count);
  const Matrix6d rotation = unseen.householderQr().householderQ();
  widened += kUnseenVariance * rotation.leftCols(count) * rotation.leftCols(count).transpose();
  return widened;
}

}  // namespace livemap::odometry
