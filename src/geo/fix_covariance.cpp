#include "geo/fix_covariance.h"

#include <Eigen/LU>
#include <cmath>

namespace livemap::geo {

bool IsFixCovariance(const Eigen::Matrix2d& covariance_m2) {
  const double trace = covariance_m2.trace();
  return covariance_m2.allFinite() && covariance_m2(0, 0) >= 0 && covariance_m2(1, 1) >= 0 &&
         trace <= 2 * kMaxFixSigmaM * kMaxFixSigmaM &&
         covariance_m2.determinant() >= -1e-9 * trace * trace &&
         std::abs(covariance_m2(0, 1) - covariance_m2(1, 0)) <= 1e-6 * trace;
}

}  // namespace livemap::geo
