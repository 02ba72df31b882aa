#pragma once

#include <cstdint>

#include "datasets/seeded_random.h"

namespace livemap::datasets {

/// What a vehicle's bus says of its motion.
struct WheelTwist {
  double speed_mps = 0;          ///< Forward.
  double yaw_rate_radps = 0;     ///< Left positive.
  double speed_variance = 0;     ///< (m/s)^2, scale error included.
  double yaw_rate_variance = 0;  ///< (rad/s)^2.
};

/// Wheel speed and the yaw rate sensor of the stability control, as vehicles report them: a scale
/// error of the tyre's radius (sigma 1 %, one per drive), noise (sigma 0.02 m/s and 0.003 rad/s),
/// then rounding to the bus's steps (0.02 m/s and 0.002 rad/s). A wheel that stands reports 0. The
/// same seed gives the same values for the same calls. Not thread-safe.
class WheelOdometerModel {
 public:
  static constexpr double kScaleSigma = 0.01;
  static constexpr double kSpeedSigmaMps = 0.02;
  static constexpr double kYawRateSigmaRadps = 0.003;
  static constexpr double kSpeedStepMps = 0.02;
  static constexpr double kYawRateStepRadps = 0.002;

  explicit WheelOdometerModel(std::uint64_t seed);

  /// Of the true values.
  WheelTwist Measure(double speed_mps, double yaw_rate_radps);
  /// Reported over true speed.
  double scale() const { return scale_; }

 private:
  SeededRandom random_;
  double scale_;
};

}  // namespace livemap::datasets
