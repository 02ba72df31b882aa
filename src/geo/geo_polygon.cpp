#include "geo/geo_polygon.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/error.h"

namespace livemap::geo {
namespace {

/// The longitude that is the same place and within 180 degrees of `origin_deg`.
double LongitudeNear(double origin_deg, double longitude_deg) {
  return origin_deg + std::remainder(longitude_deg - origin_deg, 360.0);
}

}  // namespace

GeoPolygon::GeoPolygon(std::vector<GeoPoint> corners) : corners_(std::move(corners)) {
  if (corners_.size() < 3 || corners_.size() > kMaxCorners) {
    throw Error("an area has " + std::to_string(corners_.size()) + " corners, accepted are 3 to " +
                std::to_string(kMaxCorners));
  }
  for (const GeoPoint& corner : corners_) {
    if (IsValid(corner)) continue;
    throw Error("an area has a corner at latitude " + std::to_string(corner.latitude_deg) +
                ", longitude " + std::to_string(corner.longitude_deg) +
                ", accepted are degrees of WGS84");
  }
  double west_deg = corners_.front().longitude_deg;
  double east_deg = west_deg;
  for (std::size_t i = 1; i < corners_.size(); ++i) {
    double& longitude_deg = corners_[i].longitude_deg;
    longitude_deg = LongitudeNear(corners_[i - 1].longitude_deg, longitude_deg);
    west_deg = std::min(west_deg, longitude_deg);
    east_deg = std::max(east_deg, longitude_deg);
  }
  middle_deg_ = (west_deg + east_deg) / 2;
}

/// By the number of edges that a ray to the east crosses.
bool GeoPolygon::Contains(const GeoPoint& point) const {
  const double longitude_deg = LongitudeNear(middle_deg_, point.longitude_deg);
  bool is_inside = false;
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const GeoPoint& from = corners_[i];
    const GeoPoint& to = corners_[(i + 1) % corners_.size()];
    const bool from_above = from.latitude_deg > point.latitude_deg;
    const bool to_above = to.latitude_deg > point.latitude_deg;
    if (from_above == to_above) continue;
    const double share =
        (point.latitude_deg - from.latitude_deg) / (to.latitude_deg - from.latitude_deg);
    const double edge_deg = from.longitude_deg + share * (to.longitude_deg - from.longitude_deg);
    if (edge_deg > longitude_deg) is_inside = !is_inside;
  }
  return is_inside;
}

}  // namespace livemap::geo
