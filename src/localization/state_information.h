#pragma once

#include "localization/window_factors.h"

namespace livemap::localization {

/// Gauss-Newton information about a node and the calibration around their present values: the cost
/// is d^T H d / 2 + b^T d for a small change d.
struct StateInformation {
  StateMatrix h = StateMatrix::Zero();
  StateVector b = StateVector::Zero();

  /// Adds a factor of this node; `loss` may be null.
  void Add(const ceres::CostFunction& cost, const ceres::LossFunction* loss, const NodeState& node,
           const Calibration& calibration);

  /// The same information about the next node and the calibration: the Schur complement that takes
  /// `from` out of this information and the link's.
  StateInformation PassOn(const ceres::CostFunction& link, const NodeState& from,
                          const NodeState& to, const Calibration& calibration) const;

  StateMatrix Covariance() const;
};

/// Root S of an information matrix, S^T S = covariance^-1.
StateMatrix RootInformation(const StateMatrix& covariance);

}  // namespace livemap::localization
