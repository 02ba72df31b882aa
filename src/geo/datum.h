#pragma once

#include <Eigen/Geometry>

#include "geo/wgs84.h"

namespace livemap::geo {

/// Datum of a map frame whose pose in the earth frame is given: the inverse of LocalFrame::InEarth.
/// Throws Error when the map is not an east-north-up frame that touches the ellipsoid (to a
/// centimetre and a microradian).
GeoPoint DatumOf(const Eigen::Isometry3d& earth_from_map);

/// Turn from a frame's axes to true east and north at another place, rad, counterclockwise:
/// meridians converge.
double MeridianConvergence(const LocalFrame& frame, const GeoPoint& at);

}  // namespace livemap::geo
