#include "datasets/sensors/wheel_odometer_model.h"

#include <cmath>

namespace livemap::datasets {
namespace {

/// Below this speed the wheel's sensor gives no pulses.
constexpr double kStandsMps = 0.01;

double Round(double value, double step) { return step * std::round(value / step); }

}  // namespace

WheelOdometerModel::WheelOdometerModel(std::uint64_t seed) : random_(seed) {
  scale_ = 1 + kScaleSigma * random_.Normal().x();
}

WheelTwist WheelOdometerModel::Measure(double speed_mps, double yaw_rate_radps) {
  const Eigen::Vector2d noise = random_.Normal();
  WheelTwist twist;
  if (std::abs(speed_mps) >= kStandsMps) {
    twist.speed_mps = Round(scale_ * speed_mps + kSpeedSigmaMps * noise.x(), kSpeedStepMps);
  }
  twist.yaw_rate_radps = Round(yaw_rate_radps + kYawRateSigmaRadps * noise.y(), kYawRateStepRadps);
  // Rounding to a step adds the variance of a uniform error: step^2 / 12.
  const double scale_mps = kScaleSigma * twist.speed_mps;
  twist.speed_variance =
      scale_mps * scale_mps + kSpeedSigmaMps * kSpeedSigmaMps + kSpeedStepMps * kSpeedStepMps / 12;
  twist.yaw_rate_variance =
      kYawRateSigmaRadps * kYawRateSigmaRadps + kYawRateStepRadps * kYawRateStepRadps / 12;
  return twist;
}

}  // namespace livemap::datasets
