#pragma once

// What the tables of ZoneStore accept from the file: nothing in it is taken for granted, since
// something else may have written into it. Types and sizes are checked by the database before a
// value is fetched. Nobody else includes this.
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <cstddef>

namespace livemap::zone {

constexpr std::size_t kMaxStoredTextBytes = 64;
/// Hazards and map changes are counted in 32 bits; a row beyond is none of ours.
constexpr long long kMaxRowId = 4'000'000'000;
/// More events than there will ever be; far from where a further one would overflow.
constexpr long long kMaxSequence = 1LL << 60;
constexpr double kMaxVarianceM2 = 1e8;   // Reports may say 10 km.
constexpr double kMinVarianceM2 = 1e-4;  // Fusion stops at 0.15 m.

/// A number read from the file that stands for one of `size` values, from 0.
inline bool IsIndex(int number, std::size_t size) {
  return number >= 0 && number < static_cast<int>(size);
}

inline bool IsCovariance(const Eigen::Matrix2d& covariance_m2) {
  if (!covariance_m2.allFinite() || covariance_m2.cwiseAbs().maxCoeff() > kMaxVarianceM2) {
    return false;
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(covariance_m2, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().minCoeff() >= kMinVarianceM2;
}

}  // namespace livemap::zone
