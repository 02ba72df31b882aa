#pragma once

#include <geometry_msgs/TransformStamped.h>

#include <optional>
#include <string>

#include "geo/wgs84.h"
#include "ros/parameters/shared/parameter_reader.h"

namespace livemap::ros_io {

/// Reads `map_datum`, LATITUDE,LONGITUDE in degrees; nothing when it is empty. Throws Error that
/// says what comes in its place: `otherwise`, such as "the first fix".
std::optional<geo::GeoPoint> ReadDatum(ParameterReader& parameters, const std::string& otherwise,
                                       const std::string& meaning);

/// tf `earth` -> `map_frame` (REP 105): by it all nodes of a vehicle agree about the datum.
geometry_msgs::TransformStamped EarthFromMap(const geo::GeoPoint& datum,
                                             const std::string& map_frame, const ros::Time& stamp);

}  // namespace livemap::ros_io
