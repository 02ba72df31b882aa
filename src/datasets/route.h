#pragma once

#include <string>
#include <vector>

#include "geo/wgs84.h"

namespace livemap::datasets {

/// Where a vehicle is on its route.
struct RoutePose {
  geo::GeoPoint position;
  double bearing_rad = 0;  ///< Of motion, clockwise from true north.
};

/// The line on the ellipsoid that a drive follows. Immutable.
class Route {
 public:
  /// A geodesic without end. Throws Error when `start` or `bearing_rad` is not valid.
  static Route Straight(const geo::GeoPoint& start, double bearing_rad);
  /// Geodesic pieces between at least two points that are not all equal. Throws Error.
  static Route Through(const std::vector<geo::GeoPoint>& points);

  /// Infinite for a straight route.
  double length_m() const;
  /// `distance_m` from the start; before it and past the end the route goes on straight.
  RoutePose At(double distance_m) const;

 private:
  struct Piece {
    geo::GeoPoint start;
    double bearing_rad;
    double start_m;
    double end_m;
  };
  std::vector<Piece> pieces_;
};

/// The positions of the one LineString of a GeoJSON text (RFC 7946): a bare geometry, a Feature, or
/// the first feature of a FeatureCollection. Coordinates are [longitude, latitude(, altitude)].
/// Throws Error naming the problem: too large (16 MiB), not JSON, not a LineString, a position out
/// of range.
std::vector<geo::GeoPoint> ParseRoutePoints(const std::string& geojson, const std::string& name);
/// The route through them.
Route ParseRoute(const std::string& geojson, const std::string& name);

/// Read and parse a file.
std::vector<geo::GeoPoint> ReadRoutePoints(const std::string& path);
Route ReadRoute(const std::string& path);

}  // namespace livemap::datasets
