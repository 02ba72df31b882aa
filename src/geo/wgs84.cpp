#include "geo/wgs84.h"

#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/Geodesic.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "common/error.h"

namespace livemap::geo {
namespace {

constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;

}  // namespace

bool IsValid(const GeoPoint& point) {
  // Comparisons with NaN are false, infinities are out of range.
  return std::abs(point.latitude_deg) <= 90.0 && std::abs(point.longitude_deg) <= 180.0;
}

double GeodesicDistanceM(const GeoPoint& a, const GeoPoint& b) {
  double distance_m = 0;
  GeographicLib::Geodesic::WGS84().Inverse(a.latitude_deg, a.longitude_deg, b.latitude_deg,
                                           b.longitude_deg, distance_m);
  return distance_m;
}

Eigen::Vector3d EarthCentred(const GeoPoint& point) {
  Eigen::Vector3d earth_m;
  GeographicLib::Geocentric::WGS84().Forward(point.latitude_deg, point.longitude_deg, 0.0,
                                             earth_m.x(), earth_m.y(), earth_m.z());
  return earth_m;
}

GeoPoint GeodesicDestination(const GeoPoint& start, double bearing_rad, double distance_m) {
  GeoPoint end;
  GeographicLib::Geodesic::WGS84().Direct(start.latitude_deg, start.longitude_deg,
                                          bearing_rad * kDegreesPerRadian, distance_m,
                                          end.latitude_deg, end.longitude_deg);
  return end;
}

LocalFrame::LocalFrame(const GeoPoint& datum) : datum_(datum) {
  if (!IsValid(datum)) {
    throw Error("datum (" + std::to_string(datum.latitude_deg) + ", " +
                std::to_string(datum.longitude_deg) +
                ") is no position, accepted are latitudes from -90 to 90 and longitudes from -180 "
                "to 180 degrees");
  }
  cartesian_.Reset(datum.latitude_deg, datum.longitude_deg, 0.0);
}

Eigen::Vector2d LocalFrame::ToEnu(const GeoPoint& point) const {
  double east_m = 0;
  double north_m = 0;
  double up_m = 0;
  cartesian_.Forward(point.latitude_deg, point.longitude_deg, 0.0, east_m, north_m, up_m);
  return {east_m, north_m};
}

GeoPoint LocalFrame::ToGeo(const Eigen::Vector2d& east_north_m) const {
  // The plane leaves the ellipsoid: look for the height in the plane whose point stands on the
  // ellipsoid. Each step takes the remaining height off along the up axis of the datum; the error
  // shrinks by about distance / 6400 km per step.
  GeoPoint point;
  double up_m = 0;
  for (int step = 0; step < 6; ++step) {
    double height_m = 0;
    cartesian_.Reverse(east_north_m.x(), east_north_m.y(), up_m, point.latitude_deg,
                       point.longitude_deg, height_m);
    if (std::abs(height_m) < 1e-7) break;
    up_m -= height_m;
  }
  return point;
}

Eigen::Isometry3d LocalFrame::InEarth() const {
  std::vector<double> axes(9);  // Rows first: columns are east, north, up.
  Eigen::Vector3d origin_m;
  GeographicLib::Geocentric::WGS84().Forward(datum_.latitude_deg, datum_.longitude_deg, 0.0,
                                             origin_m.x(), origin_m.y(), origin_m.z(), axes);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(axes.data());
  pose.translation() = origin_m;
  return pose;
}

}  // namespace livemap::geo
