#include "odometry/monocular/metric_scale.h"

#include <cmath>

namespace livemap::odometry {

double MetricScale::metres_per_unit() const { return std::exp(log_scale_); }

std::optional<double> MetricScale::log_sigma() const {
  if (!known_) return std::nullopt;
  return std::sqrt(variance_);
}

void MetricScale::Reset() {
  log_scale_ = 0;
  variance_ = 0;
  known_ = false;
  refused_ = 0;
}

void MetricScale::Drift() {
  if (known_) variance_ += config_.drift_per_keyframe * config_.drift_per_keyframe;
}

void MetricScale::Measure(double metres, double sigma_m, double units) {
  // Written so that NaN is refused.
  if (!(metres > 0 && units > 0 && sigma_m >= 0)) return;
  if (!std::isfinite(metres) || !std::isfinite(units) || !std::isfinite(sigma_m)) return;
  const double relative = sigma_m / metres;
  const double variance = relative * relative + config_.way_sigma * config_.way_sigma;
  const double innovation = std::log(metres / units) - log_scale_;
  const double gate = config_.gate_sigmas * std::sqrt(variance_ + variance);
  const bool contradicts = known_ && std::abs(innovation) > gate;
  if (contradicts && ++refused_ < config_.max_refused) return;
  refused_ = 0;
  if (!known_ || contradicts) {
    known_ = true;
    log_scale_ += innovation;
    variance_ = variance;
    return;
  }
  const double gain = variance_ / (variance_ + variance);
  log_scale_ += gain * innovation;
  variance_ *= 1 - gain;
}

void MetricScale::Stretch(double factor) {
  if (factor > 0 && std::isfinite(factor)) log_scale_ += std::log(factor);
}

}  // namespace livemap::odometry
