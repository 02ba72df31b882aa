#pragma once

#include <Eigen/Geometry>
#include <GeographicLib/LocalCartesian.hpp>

namespace livemap::geo {

constexpr double kRadiansPerDegree = 3.14159265358979323846 / 180.0;

/// A position on the WGS84 ellipsoid, degrees, north and east positive.
struct GeoPoint {
  double latitude_deg = 0;
  double longitude_deg = 0;
};

/// Finite, latitude within [-90, 90] and longitude within [-180, 180].
bool IsValid(const GeoPoint& point);

/// Length of the geodesic between two valid points, metres, to a few nanometres.
/// Source: C. F. F. Karney, "Algorithms for geodesics", J. Geodesy 87 (2013), as in GeographicLib.
double GeodesicDistanceM(const GeoPoint& a, const GeoPoint& b);

/// Position of a point on the ellipsoid in the earth frame of REP 105: earth-centred, metres. The
/// chord c between two such positions is shorter than the geodesic by c^3 / (24 r^2), 0.02 mm over
/// 10 km, and takes a hundredth of its time.
Eigen::Vector3d EarthCentred(const GeoPoint& point);

/// The point that lies `distance_m` from `start` along the geodesic that leaves it at
/// `bearing_rad`, clockwise from true north. `start` must be valid.
GeoPoint GeodesicDestination(const GeoPoint& start, double bearing_rad, double distance_m);

/// East-north plane that touches the ellipsoid at a datum: x east, y north, metres. Heights are
/// dropped: a point 10 km away lies 8 m below the plane, which moves it 6 mm horizontally.
class LocalFrame {
 public:
  /// Throws Error when the datum is not valid.
  explicit LocalFrame(const GeoPoint& datum);

  Eigen::Vector2d ToEnu(const GeoPoint& point) const;
  /// Inverse of ToEnu to better than a micrometre for points within 100 km of the datum.
  GeoPoint ToGeo(const Eigen::Vector2d& east_north_m) const;
  /// Pose of this frame in the earth frame of REP 105: earth-centred, metres, x to the meridian of
  /// Greenwich, z to the north pole. The datum lies on the ellipsoid.
  Eigen::Isometry3d InEarth() const;
  const GeoPoint& datum() const { return datum_; }

 private:
  GeoPoint datum_;
  GeographicLib::LocalCartesian cartesian_;
};

}  // namespace livemap::geo
