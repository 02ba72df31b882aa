#include "zone/admission/speed_rule.h"

#include <algorithm>
#include <cmath>

namespace livemap::zone {

ReportedFix FixOf(const protocol::Report& report) {
  // The root of the trace is never below the worst direction's standard deviation.
  return {report.stamp_ns, report.position, std::sqrt(report.covariance_m2.trace())};
}

double ImpliedSpeed(const ReportedFix& a, const ReportedFix& b, const SpeedRule& rule) {
  const double explained_m = rule.slack_m + 3.0 * (a.sigma_m + b.sigma_m);
  const double unexplained_m = geo::GeodesicDistanceM(a.position, b.position) - explained_m;
  if (unexplained_m <= 0) return 0;
  const double seconds =
      std::abs(static_cast<double>(a.stamp_ns) - static_cast<double>(b.stamp_ns)) * 1e-9;
  // Half a second at least: stamps of one image may differ by rounding on the way.
  return unexplained_m / std::max(0.5, seconds);
}

std::optional<double> Challenge(ReportTrack& track, const ReportedFix& fix, const SpeedRule& rule) {
  const double speed_mps = track.accepted ? ImpliedSpeed(*track.accepted, fix, rule) : 0.0;
  const bool agrees =
      track.challenger && ImpliedSpeed(*track.challenger, fix, rule) <= rule.max_speed_mps;
  track.agreeing = agrees ? track.agreeing + 1 : 1;
  if (speed_mps <= rule.max_speed_mps || track.agreeing >= rule.recovery_reports) {
    track = {fix, std::nullopt, 0};
    return std::nullopt;
  }
  track.challenger = fix;
  return speed_mps;
}

}  // namespace livemap::zone
