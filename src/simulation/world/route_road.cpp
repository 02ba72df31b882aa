#include "simulation/world/route_road.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "common/error.h"

namespace livemap::simulation {
namespace {

constexpr double kLargestTurnDeg = 120;
constexpr double kFarthestM = 100e3;
/// Gentle corners get a curve of this length where there is room.
constexpr double kEasyCurveM = 12;
constexpr double kDegrees = 180 / M_PI;
/// A difference of lengths that is rounding.
constexpr double kRoundingM = 1e-6;

struct Vertex {
  std::size_t number = 0;  ///< In the file, from 1.
  geo::GeoPoint position;
  Eigen::Vector2d place;  ///< In the world frame, m.
  double turn_rad = 0;    ///< Left positive; 0 at both ends.
  CornerCurve curve;
};

/// An angle in [-pi, pi].
double WrapRouteAngle(double angle) { return std::remainder(angle, 2 * M_PI); }

/// "the route 'x', vertex 3 (48.1, 11.5)".
std::string RouteVertexName(const Vertex& vertex, const std::string& name) {
  char place[64];
  std::snprintf(place, sizeof place, "(%.6f, %.6f)", vertex.position.latitude_deg,
                vertex.position.longitude_deg);
  return "the route '" + name + "', vertex " + std::to_string(vertex.number) + " " + place;
}

std::vector<Vertex> PlaceRouteVertices(const std::vector<geo::GeoPoint>& points,
                                       const std::string& name) {
  std::vector<Vertex> vertices;
  if (points.empty()) throw Error("the route '" + name + "' has no point");
  const geo::LocalFrame frame(points.front());
  for (std::size_t i = 0; i < points.size(); ++i) {
    Vertex vertex;
    vertex.number = i + 1;
    vertex.position = points[i];
    const double distance_m = geo::GeodesicDistanceM(points.front(), points[i]);
    if (distance_m > kFarthestM) {
      throw Error(RouteVertexName(vertex, name) + " lies " +
                  std::to_string(static_cast<long>(distance_m / 1000)) +
                  " km from the first, accepted are 100 km");
    }
    vertex.place = frame.ToEnu(points[i]);
    const bool again =
        !vertices.empty() && (vertices.back().place - vertex.place).norm() < kRoundingM;
    if (!again) vertices.push_back(vertex);
  }
  if (vertices.size() < 2) {
    throw Error("the route '" + name + "' needs at least two different points");
  }
  return vertices;
}

double RouteHeadingRad(const Vertex& from, const Vertex& to) {
  const Eigen::Vector2d way = to.place - from.place;
  return std::atan2(way.y(), way.x());
}

double RouteSegmentM(const Vertex& from, const Vertex& to) {
  return (to.place - from.place).norm();
}

void BendRouteCorners(const std::string& name, std::vector<Vertex>& vertices) {
  for (std::size_t i = 1; i + 1 < vertices.size(); ++i) {
    Vertex& vertex = vertices[i];
    vertex.turn_rad = WrapRouteAngle(RouteHeadingRad(vertex, vertices[i + 1]) -
                                     RouteHeadingRad(vertices[i - 1], vertex));
    const double turn_deg = std::abs(vertex.turn_rad) * kDegrees;
    if (turn_deg > kLargestTurnDeg) {
      std::ostringstream sentence;
      sentence.precision(1);
      sentence << std::fixed << RouteVertexName(vertex, name) << " turns by " << turn_deg
               << " degrees, accepted are at most " << kLargestTurnDeg;
      throw Error(sentence.str());
    }
    vertex.curve = TightestCurve(vertex.turn_rad);
  }
}

/// Of a segment, the part that the curve at `vertex` may have when `other` needs its own.
[[noreturn]] void RefuseRouteCorner(const std::string& name, const Vertex& vertex,
                                    const Vertex& other, double segment_m) {
  std::ostringstream sentence;
  sentence.precision(1);
  sentence << std::fixed << RouteVertexName(vertex, name) << " turns by "
           << std::abs(vertex.turn_rad) * kDegrees << " degrees and its curve of "
           << kTightestRadiusM << " m radius needs " << vertex.curve.tangent_m
           << " m of the line, the segment to vertex " << other.number << " of " << segment_m
           << " m leaves " << segment_m - other.curve.tangent_m
           << " m; accepted is a segment of at least "
           << vertex.curve.tangent_m + other.curve.tangent_m + 0.05 << " m or a gentler turn";
  throw Error(sentence.str());
}

void CheckRouteRoom(const std::string& name, const std::vector<Vertex>& vertices) {
  for (std::size_t i = 0; i + 1 < vertices.size(); ++i) {
    const Vertex& a = vertices[i];
    const Vertex& b = vertices[i + 1];
    const double segment_m = RouteSegmentM(a, b);
    if (a.curve.tangent_m + b.curve.tangent_m <= segment_m + kRoundingM) continue;
    // The sharper corner is to blame.
    const bool first = a.curve.tangent_m > b.curve.tangent_m;
    RefuseRouteCorner(name, first ? a : b, first ? b : a, segment_m);
  }
}

/// Lengthens gentle curves while they keep to their half of both segments.
void EaseRouteCorners(std::vector<Vertex>& vertices) {
  for (std::size_t i = 1; i + 1 < vertices.size(); ++i) {
    Vertex& vertex = vertices[i];
    if (vertex.curve.length_m >= kEasyCurveM || vertex.turn_rad == 0) continue;
    const double half_m = 0.5 * std::min(RouteSegmentM(vertices[i - 1], vertex),
                                         RouteSegmentM(vertex, vertices[i + 1]));
    const double scale =
        std::min(kEasyCurveM / vertex.curve.length_m, half_m / vertex.curve.tangent_m);
    if (scale > 1) vertex.curve = CurveOfLength(vertex.turn_rad, scale * vertex.curve.length_m);
  }
}

}  // namespace

CornerCurve CurveOfLength(double turn_rad, double length_m) {
  CornerCurve curve;
  curve.length_m = length_m;
  const double turn = std::abs(turn_rad);
  // Seen along the chord, the curve runs from heading turn/2 down to -turn/2; midpoint rule.
  constexpr int kSteps = 512;
  double chord = 0;
  double rise = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double t = (i + 0.5) / kSteps;
    const double heading = turn * (0.5 - t * t * (3 - 2 * t));
    chord += std::cos(heading) / kSteps;
    if (i < kSteps / 2) rise += std::sin(heading) / kSteps;
  }
  curve.tangent_m = 0.5 * length_m * chord / std::cos(0.5 * turn);
  curve.departure_m = curve.tangent_m * std::sin(0.5 * turn) - length_m * rise;
  return curve;
}

CornerCurve TightestCurve(double turn_rad) {
  // The smooth step is half again as steep at its middle as on the whole.
  return CurveOfLength(turn_rad, 1.5 * std::abs(turn_rad) * kTightestRadiusM);
}

RouteRoad LayRoad(const std::vector<geo::GeoPoint>& points, const std::string& name) {
  std::vector<Vertex> vertices = PlaceRouteVertices(points, name);
  BendRouteCorners(name, vertices);
  CheckRouteRoom(name, vertices);
  EaseRouteCorners(vertices);
  RouteRoad road;
  road.bearing_deg = 90 - RouteHeadingRad(vertices[0], vertices[1]) * kDegrees;
  if (road.bearing_deg < 0) road.bearing_deg += 360;
  for (std::size_t i = 0; i + 1 < vertices.size(); ++i) {
    const CornerCurve& next = vertices[i + 1].curve;
    const double straight_m =
        RouteSegmentM(vertices[i], vertices[i + 1]) - vertices[i].curve.tangent_m - next.tangent_m;
    if (straight_m > kRoundingM) road.pieces.push_back({straight_m, 0, 0});
    if (next.length_m > 0) {
      road.pieces.push_back({next.length_m, vertices[i + 1].turn_rad * kDegrees, 0});
    }
  }
  for (const RoadPiece& piece : road.pieces) road.length_m += piece.length_m;
  return road;
}

}  // namespace livemap::simulation
