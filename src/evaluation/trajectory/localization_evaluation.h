#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "datasets/comma2k19.h"
#include "localization/localizer_config.h"

namespace livemap::evaluation {

/// What is done to a recorded drive before the localisation sees it.
struct LocalizationTrial {
  double noise_m = 0;          ///< White noise added to the fixes, standard deviation per axis.
  double outlier_share = 0;    ///< Of the fixes that are moved away, 0..1.
  double outlier_m = 30;       ///< How far, in a random direction.
  double dropout_start_s = 0;  ///< After the first fix.
  double dropout_s = 0;        ///< No fixes for so long; 0: no drop-out.
  /// Errors of the heading's sensor: one bias per drive (standard deviation, rad/s) and a random
  /// walk (standard deviation after 1 s, rad).
  double gyro_bias_sigma_rps = 0.00087;
  double gyro_walk_rad = 0.00035;
  double fix_sigma_m = 0.5;  ///< What the receiver states per axis, without the added noise.
  bool states_noise = true;  ///< The receiver's covariance tells of the added noise.
  std::uint64_t seed = 1;
};

/// From the first to the last record of something, in s of its own clock.
struct TimeSpan {
  double from_s = 0;
  double to_s = 0;
};

/// docs/reference/measures.md defines the figures. Those of fused positions are not defined where
/// `poses` is 0, those of a fix's time where `fixes` is 0, and `fix_rmse_m` where `compared_fixes`
/// is 0: they are 0 here and null in the JSON.
struct LocalizationReport {
  std::size_t fixes = 0;
  std::size_t compared_fixes = 0;  ///< Fixes at whose moment the true pose is known.
  double fix_rmse_m = 0;
  double fused_rmse_m = 0;
  double fused_p50_m = 0;
  double fused_p95_m = 0;
  double fused_max_m = 0;
  std::size_t poses = 0;     ///< True poses with a fused one.
  double first_fused_s = 0;  ///< After the first fix.
  double nees_mean = 0;      ///< Of the position, two degrees of freedom: 2 is honest.
  std::optional<double> dropout_error_m;
  std::optional<double> dropout_end_error_m;
  std::size_t outliers_added = 0;
  std::uint64_t outliers_refused = 0;
  std::uint64_t fixes_used = 0;              ///< Of `fixes`, by the window.
  std::uint64_t fixes_invalid = 0;           ///< Out of the range of the map, or no position.
  std::uint64_t fixes_without_odometry = 0;  ///< From a time that the odometry does not cover.
  std::uint64_t fixes_out_of_order = 0;      ///< Not newer than the one before.
  /// Stretches longer than 1 s and than twice the median interval, without a true pose...
  std::size_t truth_gaps = 0;
  std::size_t odometry_gaps = 0;       ///< ...and without a wheel speed at a known heading.
  std::optional<TimeSpan> fix_span;    ///< Of the whole drive; none where it is not known.
  std::optional<TimeSpan> truth_span;  ///< The same of the true poses.
  double latency_estimate_s = 0;
  double latency_sigma_s = 0;
  bool latency_observed = false;
  double odometry_scale = 1;
  double ms_per_fix_median = 0;
  double ms_per_fix_p95 = 0;
  double ms_per_fix_max = 0;
};

/// Drives the localisation through a recorded drive as it would have run on board: what has a stamp
/// is handed over at it, and each true pose is compared with what was known at its moment. Nothing
/// is compared across a gap in the true poses, and the odometry is lost in one of the wheel speed.
/// Throws Error where wheel speed and true poses share no time.
LocalizationReport EvaluateLocalization(const datasets::PositionDrive& drive,
                                        const localization::LocalizerConfig& config,
                                        const LocalizationTrial& trial);

/// Why nothing was measured: no true pose has a fused one. None where one has.
std::optional<std::string> WhyNothingMeasured(const LocalizationReport& report);

/// What whoever reads the figures should know of the drive, a sentence each: its gaps.
std::vector<std::string> NotesOf(const LocalizationReport& report);

/// With the key "reason" where nothing was measured.
nlohmann::ordered_json ToJson(const LocalizationReport& report);
std::string ToText(const LocalizationReport& report);

}  // namespace livemap::evaluation
