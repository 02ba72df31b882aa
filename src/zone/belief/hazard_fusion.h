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
  /// Share of a report's variance that the reports of all vehicles have in common (reflections at
  /// the place, the state of the sky): it does not average out.
  double common_share = 0.1;
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

/// Merges `report`, a sighting of `hazard` by another vehicle, into it:
///   position    inverse-covariance weighting of what the two do not share, in the hazard's local
///               east-north plane (both covariances' axes are taken as parallel: within 10 m they
///               turn by less than 1e-4 rad up to 89 degrees of latitude). With the common part
///               C = k P2, V1 = P1 - C and V2 = P2 - C:
///               x = V (V1^-1 x1 + V2^-1 x2), P = C + V, V = (V1^-1 + V2^-1)^-1,
///               where k is rule.common_share, but less where P1 - C would not be a covariance:
///               at most 0.9 times the least eigenvalue of P2^-1 P1;
///   confidence  noisy-or, 1 - (1 - c1)(1 - c2), capped by the rule, never lowered;
///   sightings + 1, first and last seen.
/// Of equal covariances N reports have P = (k + (1 - k) / N) P1. Order matters little.
void Fuse(HazardEstimate& hazard, const protocol::Report& report, const FusionRule& rule);

/// Whether `report`, of the vehicle of all sightings so far, says so much better where the hazard
/// is that its place should count instead: half the area of uncertainty or less, and no further
/// away than the hazard's covariance explains (squared distance 9.2, 1 % of honest ones). Sightings
/// by one receiver share its error: they do not average, the surest counts. As each halves the
/// area, a vehicle that lies does not pull on without end.
bool IsSurer(const HazardEstimate& hazard, const protocol::Report& report, const FusionRule& rule);
/// Puts the report's place in the place of the hazard's; sightings + 1, first and last seen.
void TakePlace(HazardEstimate& hazard, const protocol::Report& report, const FusionRule& rule);

/// The hazard was seen then, too: its first and last seen span the stamp.
void NoteSeen(HazardEstimate& hazard, std::int64_t stamp_ns);

}  // namespace livemap::zone
