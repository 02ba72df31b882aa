#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

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

/// docs/reference/measures.md defines the figures.
struct LocalizationReport {
  std::size_t fixes = 0;
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
  double latency_estimate_s = 0;
  double latency_sigma_s = 0;
  bool latency_observed = false;
  double odometry_scale = 1;
  double ms_per_fix_median = 0;
  double ms_per_fix_p95 = 0;
  double ms_per_fix_max = 0;
};

/// Drives the localisation through a recorded drive as it would have run on board: what has a stamp
/// is handed over at it, and each true pose is compared with what was known at its moment.
LocalizationReport EvaluateLocalization(const datasets::PositionDrive& drive,
                                        const localization::LocalizerConfig& config,
                                        const LocalizationTrial& trial);

nlohmann::ordered_json ToJson(const LocalizationReport& report);
std::string ToText(const LocalizationReport& report);

}  // namespace livemap::evaluation
