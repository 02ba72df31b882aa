#pragma once

#include <cstdint>
#include <optional>

#include "geo/wgs84.h"
#include "protocol/report.h"

namespace livemap::zone {

/// How fast a vehicle can be.
struct SpeedRule {
  double max_speed_mps = 100.0;  ///< Between two reports of one vehicle.
  double slack_m = 100.0;        ///< A hazard lies beside or ahead of the vehicle that reports it.
  /// After so many reports in a row that agree among themselves, they are believed and what was
  /// accepted before them is not: one wrong fix shuts no vehicle out.
  std::uint32_t recovery_reports = 3;
};

/// A place that a vehicle reported.
struct ReportedFix {
  std::int64_t stamp_ns = 0;  ///< Of the image, vehicle clock (UTC).
  geo::GeoPoint position;
  double sigma_m = 0;  ///< Standard deviation of the position, along the worst direction or more.
};

ReportedFix FixOf(const protocol::Report& report);

/// Where the reports of one vehicle say it was. A small value: copied to try, assigned to keep.
struct ReportTrack {
  std::optional<ReportedFix> accepted;    ///< The last one that was accepted.
  std::optional<ReportedFix> challenger;  ///< The last one refused since.
  std::uint32_t agreeing = 0;             ///< Refused ones in a row that agree with each other.
};

/// The speed between two fixes as far as it cannot be explained by the slack and three standard
/// deviations of each, m/s; 0 when those suffice. Order does not matter: an outbox sends urgent
/// reports before older ones.
double ImpliedSpeed(const ReportedFix& a, const ReportedFix& b, const SpeedRule& rule);

/// Takes in the next fix of the vehicle. The implied speed when the rule refuses it; none when it
/// is accepted.
std::optional<double> Challenge(ReportTrack& track, const ReportedFix& fix, const SpeedRule& rule);

}  // namespace livemap::zone
