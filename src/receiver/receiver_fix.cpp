#include "receiver/receiver_fix.h"

#include <cmath>

#include "common/time.h"
#include "geo/fix_covariance.h"
#include "geo/fix_plausibility.h"

namespace livemap::receiver {
namespace {

// Radius that holds 95 % of a normal distribution in the plane with equal axes, against 1.96 of one
// axis: sqrt(-2 ln 0.05) = 2.448.
constexpr double kRadialSigmas = 2.448 / 1.96;
// No receiver is as certain as that.
constexpr double kMinSigmaM = 1e-3;
constexpr double kMinSigmaMps = 1e-3;
// Of the Dead Sea's shore and of Mount Everest, with a margin.
constexpr double kMinHeightM = -1000;
constexpr double kMaxHeightM = 10000;
constexpr double kMaxErrorMps = 1000;

bool HasPosition(const ReceiverReport& report) {
  return report.mode == ReceiverReport::kPlane || report.mode == ReceiverReport::kSpace;
}

bool IsWithin(double value, double min, double max) { return value >= min && value <= max; }

/// The standard deviation of an error estimate; nothing where it cannot be one. A NaN is nowhere.
std::optional<double> SigmaOf(double error, double sigmas, double min, double max) {
  const double sigma = error / sigmas;
  if (!IsWithin(sigma, min, max)) return std::nullopt;
  return sigma;
}

FixQuality QualityOf(int status) {
  switch (status) {
    case ReceiverReport::kDifferential:
      return FixQuality::kDifferential;
    case ReceiverReport::kRtkFixed:
    case ReceiverReport::kRtkFloating:
      return FixQuality::kRtk;
    default:
      return FixQuality::kPlain;
  }
}

/// Errors east and north as standard deviations, m; NaN where the report has none.
Eigen::Vector2d PlaneSigmas(const ReceiverReport& report, double sigmas) {
  Eigen::Vector2d stated = Eigen::Vector2d(report.east_error_m, report.north_error_m) / sigmas;
  if (stated.allFinite() && stated.minCoeff() >= kMinSigmaM) return stated;
  const double shared = report.radial_error_m / (sigmas * kRadialSigmas);
  return Eigen::Vector2d::Constant(shared >= kMinSigmaM ? shared : kNotStated);
}

std::optional<Eigen::Matrix2d> PlaneCovariance(const ReceiverReport& report,
                                               const ReceiverConfig& config) {
  const bool is_given = config.velocity_sigma_mps > 0;
  const std::optional<double> along =
      is_given ? config.velocity_sigma_mps
               : SigmaOf(report.speed_error_mps, config.error_sigmas, kMinSigmaMps, kMaxErrorMps);
  if (!along) return std::nullopt;
  if (!std::isfinite(report.course_deg)) {
    // Into any direction alike: half of the square of the speed along either axis.
    const double variance = *along * *along + report.speed_mps * report.speed_mps / 2;
    return Eigen::Matrix2d(variance * Eigen::Matrix2d::Identity());
  }
  double across = *along;
  const std::optional<double> course_deg =
      SigmaOf(report.course_error_deg, config.error_sigmas, 1e-6, 180);
  if (course_deg && !is_given) {
    across = std::max(report.speed_mps * *course_deg * geo::kRadiansPerDegree, kMinSigmaMps);
  }
  const double course_rad = report.course_deg * geo::kRadiansPerDegree;
  Eigen::Matrix2d axes;  // Columns: along the course, and to its left.
  axes << std::sin(course_rad), -std::cos(course_rad), std::cos(course_rad), std::sin(course_rad);
  const Eigen::Vector2d variances(*along * *along, across * across);
  return Eigen::Matrix2d(axes * variances.asDiagonal() * axes.transpose());
}

}  // namespace

JudgedFix FixOf(const ReceiverReport& report, const ReceiverConfig& config) {
  if (!HasPosition(report)) return {FixVerdict::kNoFix, {}};
  if (report.status == ReceiverReport::kSimulated) return {FixVerdict::kSimulated, {}};
  if (report.stamp_ns <= 0 || !IsStamp(report.stamp_ns)) return {FixVerdict::kNoTime, {}};
  ReceiverFix fix;
  fix.stamp_ns = report.stamp_ns;
  fix.position = {report.latitude_deg, report.longitude_deg};
  fix.quality = QualityOf(report.status);
  if (!geo::IsPlausible({fix.stamp_ns, true, fix.position, {}})) {
    return {FixVerdict::kBadPosition, {}};
  }
  const Eigen::Vector2d sigma_m = PlaneSigmas(report, config.error_sigmas);
  if (sigma_m.maxCoeff() > geo::kMaxFixSigmaM) return {FixVerdict::kTooUncertain, {}};
  if (sigma_m.allFinite()) fix.plane_sigma_m = sigma_m;
  if (report.mode == ReceiverReport::kSpace &&
      IsWithin(report.height_m, kMinHeightM, kMaxHeightM)) {
    fix.height_m = report.height_m;
    fix.up_sigma_m =
        SigmaOf(report.up_error_m, config.error_sigmas, kMinSigmaM, geo::kMaxFixSigmaM);
  }
  return {FixVerdict::kFix, fix};
}

JudgedVelocity VelocityOf(const ReceiverReport& report, const ReceiverConfig& config) {
  if (!FixOf(report, config).fix || std::isnan(report.speed_mps)) return {};
  const bool has_course = !std::isnan(report.course_deg);
  if (!IsWithin(report.speed_mps, 0, config.max_speed_mps) ||
      (has_course && !IsWithin(report.course_deg, 0, 360))) {
    return {true, {}};
  }
  ReceiverVelocity velocity;
  velocity.stamp_ns = report.stamp_ns;
  if (has_course) {
    const double course_rad = report.course_deg * geo::kRadiansPerDegree;
    velocity.plane_mps =
        report.speed_mps * Eigen::Vector2d(std::sin(course_rad), std::cos(course_rad));
  }
  velocity.plane_covariance = PlaneCovariance(report, config);
  if (report.mode == ReceiverReport::kSpace &&
      IsWithin(report.climb_mps, -config.max_speed_mps, config.max_speed_mps)) {
    velocity.climb_mps = report.climb_mps;
    velocity.climb_sigma_mps =
        SigmaOf(report.climb_error_mps, config.error_sigmas, kMinSigmaMps, kMaxErrorMps);
  }
  return {false, velocity};
}

const char* ReasonOf(FixVerdict verdict) {
  switch (verdict) {
    case FixVerdict::kFix:
      return "it is a fix";
    case FixVerdict::kNoFix:
      return "the receiver has no fix";
    case FixVerdict::kSimulated:
      return "the receiver says that it simulates its positions";
    case FixVerdict::kNoTime:
      return "it has a position and no time";
    case FixVerdict::kBadPosition:
      return "its position is not on the earth, or at 0 degrees north and east";
    case FixVerdict::kTooUncertain:
      return "its standard deviation is above 1000 m";
  }
  return "?";
}

}  // namespace livemap::receiver
