#include "datasets/sensors/gnss_multipath.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/error.h"

namespace livemap::datasets {

double SkyVisibility::HiddenShare() const { return (left_rad + right_rad) / M_PI; }

double SkyVisibility::LeftSurplus() const { return (left_rad - right_rad) / M_PI; }

GnssMultipath::GnssMultipath(double sigma_m, std::uint64_t seed)
    : sigma_m_(sigma_m), random_(seed) {
  if (std::isfinite(sigma_m) && sigma_m >= 0 && sigma_m < 1e6) return;
  throw Error("the receiver's multipath error in metres is " + std::to_string(sigma_m) +
              ", accepted is zero or more");
}

Eigen::Vector2d GnssMultipath::ErrorAt(double time_s, double driven_m, double heading_rad,
                                       const SkyVisibility& sky) {
  if (!started_) {
    started_ = true;
    unit_ = random_.Normal();
  } else {
    const double keep = std::exp(-std::max(0.0, driven_m - driven_m_) / kCorrelationM -
                                 std::max(0.0, time_s - time_s_) / kCorrelationS);
    unit_ = keep * unit_ + std::sqrt(1 - keep * keep) * random_.Normal();
  }
  time_s_ = time_s;
  driven_m_ = driven_m;
  const double along = sigma_m_ * sky.HiddenShare() * unit_.x();
  const double left = 2 * sigma_m_ * (sky.HiddenShare() * unit_.y() - sky.LeftSurplus());
  const double c = std::cos(heading_rad);
  const double s = std::sin(heading_rad);
  return {c * along - s * left, s * along + c * left};
}

}  // namespace livemap::datasets
