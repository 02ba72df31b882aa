#pragma once

#include <vector>

#include "geo/wgs84.h"

namespace livemap::directory {

/// The area that one zone serves: what an odd number of its rings encloses. So a ring within
/// another one is a hole, and rings beside each other are parts. Edges are straight in degrees. A
/// ring may lie across the antimeridian.
class ZoneArea {
 public:
  using Ring = std::vector<geo::GeoPoint>;

  /// The last corner of each ring is joined to its first. Throws Error that says what is accepted
  /// for an area without rings, a ring of fewer than 3 corners, a corner that is no position or
  /// lies beyond kMaxLatitudeDeg, and a ring that is wider or higher than kMaxSpanDeg.
  explicit ZoneArea(std::vector<Ring> rings);

  /// How far `point` lies from the area's border, metres: positive inside, negative outside. The
  /// distance is measured on a plane that touches the ellipsoid at the point, where it is right to
  /// a thousandth within 50 km.
  double DepthM(const geo::GeoPoint& point) const;

  /// Whether DepthM of `point` can be -`margin_m` or more: quick, by the rings' bounds.
  bool IsNear(const geo::GeoPoint& point, double margin_m) const;

  /// Whether a place can lie in both: quick, by the rings' bounds.
  bool MayOverlap(const ZoneArea& other) const;

  /// As they were given, but for longitudes, which go on beyond 180 degrees where a ring does.
  const std::vector<Ring>& rings() const { return rings_; }

  /// Nearer to a pole a degree of longitude says little, and nobody drives.
  static constexpr double kMaxLatitudeDeg = 85;
  static constexpr double kMaxSpanDeg = 20;

 private:
  struct Bounds {
    double south_deg;
    double north_deg;
    double west_deg;  ///< As the ring's corners: it may be beyond 180 degrees.
    double east_deg;
  };

  std::vector<Ring> rings_;
  std::vector<Bounds> bounds_;
};

}  // namespace livemap::directory
