#include "geo/datum.h"

#include <GeographicLib/Geocentric.hpp>
#include <cmath>

#include "common/error.h"

namespace livemap::geo {
namespace {

constexpr double kMaxShiftM = 0.01;
constexpr double kMaxTurn = 1e-6;

}  // namespace

GeoPoint DatumOf(const Eigen::Isometry3d& earth_from_map) {
  const Eigen::Vector3d origin_m = earth_from_map.translation();
  GeoPoint datum;
  double height_m = 0;
  GeographicLib::Geocentric::WGS84().Reverse(origin_m.x(), origin_m.y(), origin_m.z(),
                                             datum.latitude_deg, datum.longitude_deg, height_m);
  if (!earth_from_map.matrix().allFinite() || !IsValid(datum)) {
    throw Error("the map's pose in the earth frame is not finite");
  }
  const Eigen::Isometry3d expected = LocalFrame(datum).InEarth();
  const double shift_m = (expected.translation() - origin_m).norm();
  const double turn = (expected.linear() - earth_from_map.linear()).norm();
  if (!(shift_m <= kMaxShiftM && turn <= kMaxTurn)) {
    throw Error("the map's pose in the earth frame is " + std::to_string(shift_m) + " m and " +
                std::to_string(turn) +
                " rad off, accepted is an east-north-up frame on the WGS84 ellipsoid");
  }
  return datum;
}

double MeridianConvergence(const LocalFrame& frame, const GeoPoint& at) {
  const Eigen::Vector2d north = frame.ToEnu(GeodesicDestination(at, 0, 10.0)) - frame.ToEnu(at);
  return std::atan2(-north.x(), north.y());
}

}  // namespace livemap::geo
