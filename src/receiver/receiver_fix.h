#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "geo/wgs84.h"
#include "receiver/receiver_report.h"

namespace livemap::receiver {

/// How reports become fixes and velocities.
struct ReceiverConfig {
  /// How many standard deviations gpsd's error estimates are, along one axis. gpsd_json(5) guesses
  /// that they have a confidence of 95 %.
  double error_sigmas = 1.96;
  /// Standard deviation of the velocity along each axis, m/s, for gpsd's estimate; 0: that counts.
  double velocity_sigma_mps = 0;
  /// A faster vehicle is none, m/s; also the fastest climb.
  double max_speed_mps = 100;
};

/// How the receiver made a fix.
enum class FixQuality { kPlain, kDifferential, kRtk };

/// A position of the antenna.
struct ReceiverFix {
  std::int64_t stamp_ns = 0;
  geo::GeoPoint position;
  std::optional<double> height_m;  ///< Above the ellipsoid.
  FixQuality quality = FixQuality::kPlain;
  /// Standard deviations east and north, m. Both are known or none, and both are above 0.
  std::optional<Eigen::Vector2d> plane_sigma_m;
  std::optional<double> up_sigma_m;  ///< Above 0; known only where the height is.
};

/// A velocity of the antenna over ground.
struct ReceiverVelocity {
  std::int64_t stamp_ns = 0;
  Eigen::Vector2d plane_mps = Eigen::Vector2d::Zero();  ///< East and north.
  std::optional<double> climb_mps;                      ///< Upwards.
  /// Of the velocity in the plane, east-north axes, m^2/s^2; positive definite.
  std::optional<Eigen::Matrix2d> plane_covariance;
  std::optional<double> climb_sigma_mps;  ///< Above 0; known only where the climb is.
};

/// Why a report gives a fix or none.
enum class FixVerdict {
  kFix,
  kNoFix,        ///< The receiver itself says that it has none.
  kSimulated,    ///< The receiver says that it makes its positions up.
  kNoTime,       ///< It has a position and no time.
  kBadPosition,  ///< Not on the earth, or where receivers without a position put it.
  kTooUncertain  ///< A fix less certain than geo::kMaxFixSigmaM is none.
};

/// What became of a report's position; `fix` is set for kFix alone.
struct JudgedFix {
  FixVerdict verdict = FixVerdict::kNoFix;
  std::optional<ReceiverFix> fix;
};

/// What became of a report's velocity. `refused`: it stated one that cannot be.
struct JudgedVelocity {
  bool refused = false;
  std::optional<ReceiverVelocity> velocity;
};

/// The position of a report. Heights and error estimates that cannot be (NaN, negative, 0, above
/// kMaxFixSigmaM where they are the height's) count as not stated. Where the report has no errors
/// east and north, its radial one is shared out to both evenly.
JudgedFix FixOf(const ReceiverReport& report, const ReceiverConfig& config);

/// The velocity of a report with a fix. The error along the course is gpsd's error of the speed.
/// Across it, it is the speed times the error of the course; where none is stated, that of the
/// speed, since a receiver measures Doppler shifts alike in all directions. ReceiverConfig may
/// state another error. A speed without course (the vehicle stands) is a velocity of 0 with the
/// speed as a further error.
JudgedVelocity VelocityOf(const ReceiverReport& report, const ReceiverConfig& config);

/// The verdict as the end of a sentence, such as "it has a position and no time".
const char* ReasonOf(FixVerdict verdict);

}  // namespace livemap::receiver
