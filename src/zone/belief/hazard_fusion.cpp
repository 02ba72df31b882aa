#include "zone/belief/hazard_fusion.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>

namespace livemap::zone {

Eigen::Matrix2d WithLeastSigma(const Eigen::Matrix2d& covariance_m2, double min_sigma_m) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(covariance_m2);
  const double least = min_sigma_m * min_sigma_m;
  if (solver.eigenvalues().minCoeff() >= least) return covariance_m2;
  const Eigen::Vector2d raised = solver.eigenvalues().cwiseMax(least);
  return solver.eigenvectors() * raised.asDiagonal() * solver.eigenvectors().transpose();
}

void Fuse(HazardEstimate& hazard, const protocol::Report& report, const FusionRule& rule) {
  const geo::LocalFrame frame(hazard.position);
  const Eigen::Vector2d offset = frame.ToEnu(report.position);
  const Eigen::Matrix2d report_covariance =
      WithLeastSigma(report.covariance_m2, rule.min_report_sigma_m);
  // With x1 = 0 the update is x = P1 (P1 + P2)^-1 x2 and P = P1 - P1 (P1 + P2)^-1 P1.
  const Eigen::Matrix2d gain =
      hazard.covariance_m2 * (hazard.covariance_m2 + report_covariance).inverse();
  const Eigen::Matrix2d fused = hazard.covariance_m2 - gain * hazard.covariance_m2;
  hazard.position = frame.ToGeo(gain * offset);
  hazard.covariance_m2 = WithLeastSigma(0.5 * (fused + fused.transpose()), rule.min_fused_sigma_m);

  const float noisy_or = 1.0F - (1.0F - hazard.confidence) * (1.0F - report.confidence);
  hazard.confidence = std::max(hazard.confidence, std::min(rule.max_confidence, noisy_or));
  hazard.sightings += 1;
  NoteSeen(hazard, report.stamp_ns);
}

void NoteSeen(HazardEstimate& hazard, std::int64_t stamp_ns) {
  hazard.first_seen_ns = std::min(hazard.first_seen_ns, stamp_ns);
  hazard.last_seen_ns = std::max(hazard.last_seen_ns, stamp_ns);
}

}  // namespace livemap::zone
