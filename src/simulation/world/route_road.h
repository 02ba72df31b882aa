#pragma once

#include <string>
#include <vector>

#include "geo/wgs84.h"
#include "simulation/world/world_file.h"

namespace livemap::simulation {

/// A road along a line on the map. The world's origin is the line's first point.
struct RouteRoad {
  double bearing_deg = 0;  ///< At the start, clockwise from north.
  std::vector<RoadPiece> pieces;
  double length_m = 0;  ///< Of all pieces.
};

/// A smooth curve between two straights that meet at a corner: the heading follows RoadPiece's
/// smooth step over `length_m`, so that the radius is two thirds of length over turn at its middle
/// and grows without end towards both straights.
struct CornerCurve {
  double length_m = 0;
  double tangent_m = 0;    ///< From the corner to where the curve begins and ends.
  double departure_m = 0;  ///< From the corner to the curve's middle: as far as road and line part.
};

/// The curve of a turn (radians, either hand, below a half turn) over `length_m`.
CornerCurve CurveOfLength(double turn_rad, double length_m);
/// The shortest such curve that is nowhere tighter than kTightestRadiusM.
CornerCurve TightestCurve(double turn_rad);

/// Lays a level road along the line through `points` (as the file `name` gives them): straight on
/// the segments, curves as tight as roads may be at the corners, somewhat longer ones where a
/// gentle corner has room. The road departs from the line at corners only, by departure_m of their
/// curves: 0.1 m at 5 degrees, 0.2 m at 10, 1.9 m at 30, 8.4 m at 60, 23 m at 90. Corners of a
/// dense line need a mean radius of 72 m. Throws Error naming the vertex (counted from 1) with its
/// position and what would be accepted: turns of at most 120 degrees, segments that are as long as
/// the curves at their ends need, points within 100 km of the first, two different points.
RouteRoad LayRoad(const std::vector<geo::GeoPoint>& points, const std::string& name);

}  // namespace livemap::simulation
