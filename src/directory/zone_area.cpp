#include "directory/zone_area.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>

#include "common/error.h"

namespace livemap::directory {
namespace {

constexpr double kSemiMajorAxisM = 6378137.0;  // WGS84.
constexpr double kFlattening = 1 / 298.257223563;

/// The longitude that is the same place and within 180 degrees of `origin_deg`.
double LongitudeBeside(double origin_deg, double longitude_deg) {
  return origin_deg + std::remainder(longitude_deg - origin_deg, 360.0);
}

/// Metres per degree at a latitude: by the ellipsoid's radii of curvature.
struct DegreeLength {
  explicit DegreeLength(double latitude_deg) {
    constexpr double kSquaredEccentricity = kFlattening * (2 - kFlattening);
    const double latitude = latitude_deg * geo::kRadiansPerDegree;
    const double w2 = 1 - kSquaredEccentricity * std::sin(latitude) * std::sin(latitude);
    const double prime_vertical_m = kSemiMajorAxisM / std::sqrt(w2);
    east_m = geo::kRadiansPerDegree * prime_vertical_m * std::cos(latitude);
    north_m = geo::kRadiansPerDegree * prime_vertical_m * (1 - kSquaredEccentricity) / w2;
  }
  double east_m;
  double north_m;
};

/// Squared distance of the origin from the line between two points.
double SquaredDistanceToOrigin(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const Eigen::Vector2d way = to - from;
  const double length2 = way.squaredNorm();
  const double share = length2 > 0 ? std::clamp(-from.dot(way) / length2, 0.0, 1.0) : 0.0;
  return (from + share * way).squaredNorm();
}

/// Whether a ray from the origin to the east crosses the edge.
bool IsEastOfOrigin(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  if ((from.y() > 0) == (to.y() > 0)) return false;
  return from.x() - from.y() * (to.x() - from.x()) / (to.y() - from.y()) > 0;
}

void CheckCorner(const geo::GeoPoint& corner) {
  if (IsValid(corner) && std::abs(corner.latitude_deg) <= ZoneArea::kMaxLatitudeDeg) return;
  throw Error("a corner is at longitude " + std::to_string(corner.longitude_deg) + ", latitude " +
              std::to_string(corner.latitude_deg) +
              ", accepted are degrees of WGS84 with latitudes from -85 to 85");
}

}  // namespace

ZoneArea::ZoneArea(std::vector<Ring> rings) : rings_(std::move(rings)) {
  if (rings_.empty()) throw Error("the area has no ring, accepted is one or more");
  for (Ring& ring : rings_) {
    if (ring.size() < 3) {
      throw Error("a ring has " + std::to_string(ring.size()) +
                  " different corners, accepted are 3 or more");
    }
    Bounds bounds{90, -90, ring.front().longitude_deg, ring.front().longitude_deg};
    for (std::size_t i = 0; i < ring.size(); ++i) {
      CheckCorner(ring[i]);
      double& longitude_deg = ring[i].longitude_deg;
      if (i > 0) longitude_deg = LongitudeBeside(ring[i - 1].longitude_deg, longitude_deg);
      bounds.south_deg = std::min(bounds.south_deg, ring[i].latitude_deg);
      bounds.north_deg = std::max(bounds.north_deg, ring[i].latitude_deg);
      bounds.west_deg = std::min(bounds.west_deg, longitude_deg);
      bounds.east_deg = std::max(bounds.east_deg, longitude_deg);
    }
    const double span_deg =
        std::max(bounds.north_deg - bounds.south_deg, bounds.east_deg - bounds.west_deg);
    if (span_deg > kMaxSpanDeg) {
      throw Error("a ring spans " + std::to_string(span_deg) + " degrees, accepted are at most " +
                  std::to_string(static_cast<int>(kMaxSpanDeg)));
    }
    bounds_.push_back(bounds);
  }
}

double ZoneArea::DepthM(const geo::GeoPoint& point) const {
  const DegreeLength degree(point.latitude_deg);
  double nearest2 = std::numeric_limits<double>::infinity();
  bool is_inside = false;
  for (std::size_t i = 0; i < rings_.size(); ++i) {
    const double middle_deg = (bounds_[i].west_deg + bounds_[i].east_deg) / 2;
    const double longitude_deg = LongitudeBeside(middle_deg, point.longitude_deg);
    const auto on_plane = [&](const geo::GeoPoint& corner) {
      return Eigen::Vector2d(degree.east_m * (corner.longitude_deg - longitude_deg),
                             degree.north_m * (corner.latitude_deg - point.latitude_deg));
    };
    Eigen::Vector2d from = on_plane(rings_[i].back());
    for (const geo::GeoPoint& corner : rings_[i]) {
      const Eigen::Vector2d to = on_plane(corner);
      nearest2 = std::min(nearest2, SquaredDistanceToOrigin(from, to));
      if (IsEastOfOrigin(from, to)) is_inside = !is_inside;
      from = to;
    }
  }
  return is_inside ? std::sqrt(nearest2) : -std::sqrt(nearest2);
}

bool ZoneArea::IsNear(const geo::GeoPoint& point, double margin_m) const {
  const DegreeLength degree(point.latitude_deg);
  const double north_deg = margin_m / degree.north_m;
  const double east_deg = margin_m / degree.east_m;
  return std::any_of(bounds_.begin(), bounds_.end(), [&](const Bounds& bounds) {
    const double middle_deg = (bounds.west_deg + bounds.east_deg) / 2;
    const double longitude_deg = LongitudeBeside(middle_deg, point.longitude_deg);
    return point.latitude_deg >= bounds.south_deg - north_deg &&
           point.latitude_deg <= bounds.north_deg + north_deg &&
           longitude_deg >= bounds.west_deg - east_deg &&
           longitude_deg <= bounds.east_deg + east_deg;
  });
}

bool ZoneArea::MayOverlap(const ZoneArea& other) const {
  const auto meet = [](const Bounds& a, const Bounds& b) {
    const double shift_deg =
        LongitudeBeside(a.west_deg, b.west_deg) - b.west_deg;  // A whole number of turns.
    const auto share_longitudes = [&](double turn_deg) {
      return b.west_deg + turn_deg <= a.east_deg && b.east_deg + turn_deg >= a.west_deg;
    };
    return a.south_deg <= b.north_deg && b.south_deg <= a.north_deg &&
           (share_longitudes(shift_deg) || share_longitudes(shift_deg - 360) ||
            share_longitudes(shift_deg + 360));
  };
  for (const Bounds& own : bounds_) {
    for (const Bounds& others : other.bounds_) {
      if (meet(own, others)) return true;
    }
  }
  return false;
}

}  // namespace livemap::directory
