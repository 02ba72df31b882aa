#pragma once

#include <Eigen/Core>
#include <algorithm>

namespace livemap::geo {

/// From a place to the nearest point of the straight line between two others, on one plane, m.
inline double OffLineM(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m,
                       const Eigen::Vector2d& place_m) {
  const Eigen::Vector2d way = to_m - from_m;
  const double square = way.squaredNorm();
  const double share = square > 0 ? std::clamp(way.dot(place_m - from_m) / square, 0.0, 1.0) : 0;
  return (place_m - from_m - share * way).norm();
}

}  // namespace livemap::geo
