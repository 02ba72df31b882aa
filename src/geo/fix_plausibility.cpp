#include "geo/fix_plausibility.h"

#include <algorithm>
#include <cmath>

#include "common/time.h"
#include "geo/fix_covariance.h"

namespace livemap::geo {
namespace {

constexpr double kNullIslandDeg = 1e-6;
constexpr double kMinStatedVarianceM2 = 1e-6;
constexpr double kMaxJumpAllowanceM = 30;  // What uncertainty may excuse between two fixes.

}  // namespace

bool IsPlausible(const Fix& fix) {
  const GeoPoint& place = fix.position;
  const bool null_island = std::abs(place.latitude_deg) < kNullIslandDeg &&
                           std::abs(place.longitude_deg) < kNullIslandDeg;
  return fix.stamp_ns > 0 && IsValid(place) && !null_island &&
         (!fix.covariance_m2 || IsFixCovariance(*fix.covariance_m2));
}

Eigen::Matrix2d CovarianceOf(const Fix& fix, double default_sigma_m) {
  if (fix.covariance_m2 && fix.covariance_m2->diagonal().minCoeff() > kMinStatedVarianceM2) {
    return *fix.covariance_m2;
  }
  return Eigen::Matrix2d::Identity() * default_sigma_m * default_sigma_m;
}

bool AreReachable(const ReceiverPoint& a, const ReceiverPoint& b, double max_speed_mps) {
  const double allowance_m = std::min(kMaxJumpAllowanceM, 3 * (a.sigma_m + b.sigma_m));
  const double way_m = max_speed_mps * std::abs(Seconds(b.stamp_ns - a.stamp_ns)) + allowance_m;
  return GeodesicDistanceM(a.position, b.position) <= way_m;
}

}  // namespace livemap::geo
