#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "protocol/report.h"

namespace livemap::zone {

/// How a further sighting refines a hazard.
struct FusionRule {
  /// No report counts as more precise than this per axis, so that none outweighs all others.
  double min_report_sigma_m = 0.3;
  /// Errors of sightings are correlated (same receiver, same map of the street): the fused position
  /// never claims more, and so never freezes.
  double min_fused_sigma_m = 0.15;
  float max_confidence = 0.99F;
};

/// What all sightings of one hazard say together.
struct HazardEstimate {
  float confidence = 0;  ///< 0..1.
  std::uint32_t sightings = 1;
  geo::GeoPoint position;
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Identity();  ///< East-north, of `position`.
  std::int64_t first_seen_ns = 0;                               ///< Oldest image stamp.
  std::int64_t last_seen_ns = 0;                                ///< Newest image stamp.
};

/// The covariance with its eigenvalues raised to at least `min_sigma_m` squared.
Eigen::Matrix2d WithLeastSigma(const Eigen::Matrix2d& covariance_m2, double min_sigma_m);

/// Merges `report`, a sighting of `hazard`, into it:
///   position    inverse-covariance weighting, x = P (P1^-1 x1 + P2^-1 x2) with
///               P = (P1^-1 + P2^-1)^-1, in the hazard's local east-north plane (both covariances'
///               axes are taken as parallel: within 10 m they turn by less than 1e-4 rad up to 89
///               degrees of latitude);
///   confidence  noisy-or, 1 - (1 - c1)(1 - c2), capped by the rule, never lowered;
///   sightings + 1, first and last seen.
/// Order matters only through the two floors and the cap.
void Fuse(HazardEstimate& hazard, const protocol::Report& report, const FusionRule& rule);

/// The hazard was seen then, too: its first and last seen span the stamp.
void NoteSeen(HazardEstimate& hazard, std::int64_t stamp_ns);

}  // namespace livemap::zone
