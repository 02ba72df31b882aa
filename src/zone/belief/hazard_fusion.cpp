#include "zone/belief/hazard_fusion.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>

namespace livemap::zone {
namespace {

constexpr double kMostInCommon = 0.9;  // Of the surer one's variance.
constexpr double kSurerArea = 0.5;
constexpr double kSameHazard2 = 9.21;  // 99 % of two degrees of freedom.

/// The share of `report_m2` that both have in common.
double CommonShareOf(const Eigen::Matrix2d& hazard_m2, const Eigen::Matrix2d& report_m2,
                     double common_share) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix2d> axes(
      hazard_m2, report_m2, Eigen::EigenvaluesOnly | Eigen::Ax_lBx);
  return std::clamp(kMostInCommon * axes.eigenvalues().minCoeff(), 0.0, common_share);
}

}  // namespace

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
  const double share = CommonShareOf(hazard.covariance_m2, report_covariance, rule.common_share);
  const Eigen::Matrix2d common = share * report_covariance;
  const Eigen::Matrix2d own = hazard.covariance_m2 - common;
  // With x1 = 0 the update is x = V1 (V1 + V2)^-1 x2 and V = V1 - V1 (V1 + V2)^-1 V1.
  const Eigen::Matrix2d gain = own * (own + report_covariance - common).inverse();
  const Eigen::Matrix2d fused = common + own - gain * own;
  hazard.position = frame.ToGeo(gain * offset);
  hazard.covariance_m2 = WithLeastSigma(0.5 * (fused + fused.transpose()), rule.min_fused_sigma_m);

  const float noisy_or = 1.0F - (1.0F - hazard.confidence) * (1.0F - report.confidence);
  hazard.confidence = std::max(hazard.confidence, std::min(rule.max_confidence, noisy_or));
  hazard.sightings += 1;
  NoteSeen(hazard, report.stamp_ns);
}

bool IsSurer(const HazardEstimate& hazard, const protocol::Report& report, const FusionRule& rule) {
  const Eigen::Matrix2d report_m2 = WithLeastSigma(report.covariance_m2, rule.min_report_sigma_m);
  const double area = hazard.covariance_m2.determinant();
  if (!(report_m2.determinant() <= kSurerArea * kSurerArea * area)) return false;
  const Eigen::Vector2d offset = geo::LocalFrame(hazard.position).ToEnu(report.position);
  return offset.dot(hazard.covariance_m2.inverse() * offset) <= kSameHazard2;
}

void TakePlace(HazardEstimate& hazard, const protocol::Report& report, const FusionRule& rule) {
  hazard.position = report.position;
  hazard.covariance_m2 = WithLeastSigma(report.covariance_m2, rule.min_report_sigma_m);
  hazard.sightings += 1;
  NoteSeen(hazard, report.stamp_ns);
}

void NoteSeen(HazardEstimate& hazard, std::int64_t stamp_ns) {
  hazard.first_seen_ns = std::min(hazard.first_seen_ns, stamp_ns);
  hazard.last_seen_ns = std::max(hazard.last_seen_ns, stamp_ns);
}

}  // namespace livemap::zone
