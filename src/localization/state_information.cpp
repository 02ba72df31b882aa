#include "localization/state_information.h"

#include <Eigen/Cholesky>
#include <array>

namespace livemap::localization {
namespace {

template <int kRows, int kColumns>
using RowMajor = Eigen::Matrix<double, kRows, kColumns, Eigen::RowMajor>;

/// Eigen's LLT of a matrix that rounding may have left without its last small eigenvalue.
Eigen::LLT<StateMatrix> DecomposeInformation(const StateMatrix& matrix) {
  Eigen::LLT<StateMatrix> decomposed(matrix);
  double lift = 1e-12;
  while (decomposed.info() != Eigen::Success && lift < 1) {
    StateMatrix lifted = matrix;
    lifted.diagonal() += lift * (matrix.diagonal().cwiseAbs() + StateVector::Constant(1e-9));
    decomposed.compute(lifted);
    lift *= 100;
  }
  return decomposed;
}

}  // namespace

void StateInformation::Add(const ceres::CostFunction& cost, const ceres::LossFunction* loss,
                           const NodeState& node, const Calibration& calibration) {
  const int rows = cost.num_residuals();  // At most those of the prior.
  Eigen::Matrix<double, kStateSize, 1> residual = StateVector::Zero();
  RowMajor<kStateSize, kNodeSize> by_node = RowMajor<kStateSize, kNodeSize>::Zero();
  RowMajor<kStateSize, kCalibrationSize> by_calibration =
      RowMajor<kStateSize, kCalibrationSize>::Zero();
  const std::array<const double*, 2> parameters{node.data(), calibration.data()};
  std::array<double*, 2> jacobians{by_node.data(), by_calibration.data()};
  if (!cost.Evaluate(parameters.data(), residual.data(), jacobians.data())) return;
  double weight = 1;
  if (loss != nullptr) {
    std::array<double, 3> rho{};
    loss->Evaluate(residual.head(rows).squaredNorm(), rho.data());
    weight = rho[1];
  }
  RowMajor<kStateSize, kStateSize> jacobian;
  jacobian << by_node, by_calibration;
  h += weight * jacobian.transpose() * jacobian;
  b += weight * jacobian.transpose() * residual;
}

StateInformation StateInformation::PassOn(const ceres::CostFunction& link, const NodeState& from,
                                          const NodeState& to,
                                          const Calibration& calibration) const {
  Eigen::Matrix<double, 5, 1> residual;
  RowMajor<5, kNodeSize> by_from;
  RowMajor<5, kNodeSize> by_to;
  RowMajor<5, kCalibrationSize> by_calibration;
  const std::array<const double*, 3> parameters{from.data(), to.data(), calibration.data()};
  std::array<double*, 3> jacobians{by_from.data(), by_to.data(), by_calibration.data()};
  link.Evaluate(parameters.data(), residual.data(), jacobians.data());
  Eigen::Matrix<double, 5, kStateSize> by_kept;
  by_kept << by_to, by_calibration;

  const Eigen::Matrix<double, kNodeSize, kNodeSize> h_out =
      h.topLeftCorner<kNodeSize, kNodeSize>() + by_from.transpose() * by_from;
  const NodeState b_out = b.head<kNodeSize>() + by_from.transpose() * residual;
  Eigen::Matrix<double, kNodeSize, kStateSize> h_cross = by_from.transpose() * by_kept;
  h_cross.rightCols<kCalibrationSize>() += h.topRightCorner<kNodeSize, kCalibrationSize>();

  StateInformation kept;
  kept.h = by_kept.transpose() * by_kept;
  kept.h.bottomRightCorner<kCalibrationSize, kCalibrationSize>() +=
      h.bottomRightCorner<kCalibrationSize, kCalibrationSize>();
  kept.b = by_kept.transpose() * residual;
  kept.b.tail<kCalibrationSize>() += b.tail<kCalibrationSize>();
  const Eigen::LDLT<Eigen::Matrix<double, kNodeSize, kNodeSize>> solver(h_out);
  kept.h -= h_cross.transpose() * solver.solve(h_cross);
  kept.b -= h_cross.transpose() * solver.solve(b_out);
  kept.h = 0.5 * (kept.h + kept.h.transpose()).eval();
  return kept;
}

StateMatrix StateInformation::Covariance() const {
  const StateMatrix covariance = DecomposeInformation(h).solve(StateMatrix::Identity());
  return 0.5 * (covariance + covariance.transpose());
}

StateMatrix RootInformation(const StateMatrix& covariance) {
  const StateMatrix information = DecomposeInformation(covariance).solve(StateMatrix::Identity());
  return DecomposeInformation(0.5 * (information + information.transpose())).matrixU();
}

}  // namespace livemap::localization
