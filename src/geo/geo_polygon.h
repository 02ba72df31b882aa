#pragma once

#include <cstddef>
#include <vector>

#include "geo/wgs84.h"

namespace livemap::geo {

/// An area within a simple polygon of corners, whose edges are straight in degrees. It may lie
/// across the antimeridian, but not around a pole: no two neighbouring corners are 180 degrees of
/// longitude apart or more.
class GeoPolygon {
 public:
  /// The last corner is joined to the first. Throws Error that says what is accepted for fewer than
  /// 3 corners, more than kMaxCorners, and corners that are no position.
  explicit GeoPolygon(std::vector<GeoPoint> corners);

  /// Whether the point is inside; one on an edge may be counted either way.
  bool Contains(const GeoPoint& point) const;

  static constexpr std::size_t kMaxCorners = 1000;

 private:
  std::vector<GeoPoint> corners_;  ///< Longitudes go on beyond 180 degrees where the area does.
  double middle_deg_ = 0;  ///< Longitude halfway between its edges in the west and the east.
};

}  // namespace livemap::geo
