#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "geo/wgs84.h"
#include "streets/street_place.h"
#include "zone/model/hazard.h"

namespace livemap::zone {

/// A place as the streets are asked about it. `covariance_m2` is of the place, east-north,
/// symmetric; `course_rad` that of who passed it, NaN where it is not known.
inline streets::Spot SpotOf(const geo::GeoPoint& place, const Eigen::Matrix2d& covariance_m2,
                            double course_rad) {
  const double mean = 0.5 * covariance_m2.trace();
  const double half = 0.5 * (covariance_m2(0, 0) - covariance_m2(1, 1));
  const double largest = mean + std::hypot(half, covariance_m2(0, 1));
  return {place, std::sqrt(std::max(0.0, largest)), course_rad};
}

inline streets::Spot SpotOf(const Hazard& hazard) {
  return SpotOf(hazard.position, hazard.covariance_m2, hazard.course_rad);
}

}  // namespace livemap::zone
