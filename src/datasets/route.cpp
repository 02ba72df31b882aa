#include "datasets/route.h"

#include <GeographicLib/Geodesic.hpp>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/error.h"
#include "common/text_file.h"
#include "geo/wgs84.h"

namespace livemap::datasets {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxRouteBytes = 16U << 20U;
constexpr std::size_t kMaxPoints = 1000000;
constexpr int kMaxDepth = 32;

double BearingRad(const geo::GeoPoint& from, const geo::GeoPoint& to) {
  double forward_deg = 0;
  double arrival_deg = 0;
  GeographicLib::Geodesic::WGS84().Inverse(from.latitude_deg, from.longitude_deg, to.latitude_deg,
                                           to.longitude_deg, forward_deg, arrival_deg);
  return forward_deg * geo::kRadiansPerDegree;
}

std::string KindOf(const json& object) {
  const auto type = object.is_object() ? object.find("type") : object.end();
  if (!object.is_object() || type == object.end() || !type->is_string()) return "nothing";
  return type->get<std::string>();
}

/// The geometry that a route is read from.
json FindGeometry(const json& root, const std::string& name) {
  json object = root;
  if (KindOf(object) == "FeatureCollection") {
    const auto features = object.find("features");
    if (features == object.end() || !features->is_array() || features->empty()) {
      throw Error("the route '" + name + "' is a FeatureCollection without a feature");
    }
    object = json(features->front());
  }
  if (KindOf(object) == "Feature") {
    const auto geometry = object.find("geometry");
    object = geometry == object.end() ? json() : json(*geometry);
  }
  if (KindOf(object) != "LineString") {
    throw Error("the route '" + name + "' holds " + KindOf(object).substr(0, 40) +
                ", accepted is a GeoJSON LineString");
  }
  return object;
}

geo::GeoPoint ParsePosition(const json& position, std::size_t index, const std::string& name) {
  const bool numbers = position.is_array() && (position.size() == 2 || position.size() == 3) &&
                       std::all_of(position.begin(), position.end(),
                                   [](const json& value) { return value.is_number(); });
  geo::GeoPoint point;
  if (numbers) point = {position[1].get<double>(), position[0].get<double>()};
  if (!numbers || !geo::IsValid(point)) {
    throw Error("position " + std::to_string(index) + " of the route '" + name + "' is " +
                position.dump().substr(0, 60) + ", accepted is [longitude, latitude] in degrees");
  }
  return point;
}

/// Refuses deep nesting before a tree is built from it.
json ParseJson(const std::string& text, const std::string& name) {
  const auto shallow = [](int depth, json::parse_event_t, json&) {
    if (depth > kMaxDepth) throw Error("nested deeper than " + std::to_string(kMaxDepth));
    return true;
  };
  try {
    return json::parse(text, shallow);
  } catch (const std::exception& exception) {
    throw Error("the route '" + name + "' is no GeoJSON: " + exception.what());
  }
}

}  // namespace

Route Route::Straight(const geo::GeoPoint& start, double bearing_rad) {
  if (!geo::IsValid(start)) {
    throw Error("the start is " + std::to_string(start.latitude_deg) + "," +
                std::to_string(start.longitude_deg) + ", accepted is LAT,LON in degrees");
  }
  if (!std::isfinite(bearing_rad)) throw Error("the bearing must be a finite number");
  Route route;
  route.pieces_.push_back({start, bearing_rad, 0, std::numeric_limits<double>::infinity()});
  return route;
}

Route Route::Through(const std::vector<geo::GeoPoint>& points) {
  Route route;
  double at_m = 0;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const double length_m = geo::GeodesicDistanceM(points[i], points[i + 1]);
    if (length_m == 0) continue;
    route.pieces_.push_back(
        {points[i], BearingRad(points[i], points[i + 1]), at_m, at_m + length_m});
    at_m += length_m;
  }
  if (route.pieces_.empty()) throw Error("a route needs at least two different points");
  return route;
}

double Route::length_m() const { return pieces_.back().end_m; }

RoutePose Route::At(double distance_m) const {
  const auto after = std::upper_bound(
      pieces_.begin(), pieces_.end(), distance_m,
      [](double distance, const Piece& piece) { return distance < piece.start_m; });
  const Piece& piece = after == pieces_.begin() ? *after : *std::prev(after);
  const double along_m = distance_m - piece.start_m;
  RoutePose pose;
  pose.position = geo::GeodesicDestination(piece.start, piece.bearing_rad, along_m);
  // A geodesic's bearing drifts with the meridians: take it where the vehicle is.
  pose.bearing_rad = BearingRad(
      pose.position, geo::GeodesicDestination(piece.start, piece.bearing_rad, along_m + 10));
  return pose;
}

std::vector<geo::GeoPoint> ParseRoutePoints(const std::string& geojson, const std::string& name) {
  if (geojson.size() > kMaxRouteBytes) {
    throw Error("the route '" + name + "' has " + std::to_string(geojson.size()) +
                " bytes, accepted are " + std::to_string(kMaxRouteBytes));
  }
  const json geometry = FindGeometry(ParseJson(geojson, name), name);
  const auto coordinates = geometry.find("coordinates");
  if (coordinates == geometry.end() || !coordinates->is_array() || coordinates->size() < 2 ||
      coordinates->size() > kMaxPoints) {
    throw Error("the route '" + name + "' needs 2 to " + std::to_string(kMaxPoints) +
                " positions in 'coordinates'");
  }
  std::vector<geo::GeoPoint> points;
  points.reserve(coordinates->size());
  for (std::size_t i = 0; i < coordinates->size(); ++i) {
    points.push_back(ParsePosition((*coordinates)[i], i + 1, name));
  }
  return points;
}

Route ParseRoute(const std::string& geojson, const std::string& name) {
  const std::vector<geo::GeoPoint> points = ParseRoutePoints(geojson, name);
  try {
    return Route::Through(points);
  } catch (const Error& error) {
    throw Error("the route '" + name + "': " + error.what());
  }
}

std::vector<geo::GeoPoint> ReadRoutePoints(const std::string& path) {
  return ParseRoutePoints(ReadTextFile(path, kMaxRouteBytes), path);
}

Route ReadRoute(const std::string& path) {
  return ParseRoute(ReadTextFile(path, kMaxRouteBytes), path);
}

}  // namespace livemap::datasets
