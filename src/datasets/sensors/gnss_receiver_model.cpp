#include "datasets/sensors/gnss_receiver_model.h"

#include <cmath>
#include <limits>
#include <string>

#include "common/error.h"

namespace livemap::datasets {
namespace {

void CheckValue(const char* name, double value, bool may_be_zero) {
  if (std::isfinite(value) && (value > 0 || (may_be_zero && value == 0)) && value < 1e9) return;
  throw Error("the receiver's " + std::string(name) + " is " + std::to_string(value) +
              ", accepted is " + (may_be_zero ? "zero or more" : "more than zero"));
}

}  // namespace

void Check(const GnssReceiverNoise& noise) {
  CheckValue("white noise in metres", noise.white_sigma_m, true);
  CheckValue("bias in metres", noise.bias_sigma_m, true);
  CheckValue("bias time constant in seconds", noise.bias_time_constant_s, false);
  CheckValue("number of drop-outs per minute", noise.dropouts_per_minute, true);
  CheckValue("mean drop-out in seconds", noise.dropout_mean_s, false);
}

GnssReceiverModel::GnssReceiverModel(const GnssReceiverNoise& noise, std::uint64_t seed)
    : noise_(noise), random_(seed) {
  Check(noise);
}

double GnssReceiverModel::sigma_m() const {
  return std::hypot(noise_.white_sigma_m, noise_.bias_sigma_m);
}

std::optional<Eigen::Vector2d> GnssReceiverModel::ErrorAt(double time_s) {
  const double between_dropouts_s = noise_.dropouts_per_minute > 0
                                        ? 60 / noise_.dropouts_per_minute
                                        : std::numeric_limits<double>::infinity();
  if (!started_) {
    started_ = true;
    bias_time_s_ = time_s;
    bias_m_ = noise_.bias_sigma_m * random_.Normal();
    dropout_start_s_ = time_s + random_.Exponential(between_dropouts_s);
    dropout_end_s_ = dropout_start_s_ + random_.Exponential(noise_.dropout_mean_s);
  }
  // Exact discretisation: stationary for any step.
  const double keep = std::exp(-(time_s - bias_time_s_) / noise_.bias_time_constant_s);
  bias_m_ = keep * bias_m_ + noise_.bias_sigma_m * std::sqrt(1 - keep * keep) * random_.Normal();
  bias_time_s_ = time_s;
  const Eigen::Vector2d error_m = bias_m_ + noise_.white_sigma_m * random_.Normal();
  while (time_s >= dropout_end_s_) {
    dropout_start_s_ = dropout_end_s_ + random_.Exponential(between_dropouts_s);
    dropout_end_s_ = dropout_start_s_ + random_.Exponential(noise_.dropout_mean_s);
  }
  if (time_s >= dropout_start_s_) return std::nullopt;
  return error_m;
}

}  // namespace livemap::datasets
