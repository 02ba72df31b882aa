#include "ros/parameters/shared/datum_parameter.h"

#include <tf2_eigen/tf2_eigen.h>

#include <cstdio>

namespace livemap::ros_io {

std::optional<geo::GeoPoint> ReadDatum(ParameterReader& parameters, const std::string& otherwise,
                                       const std::string& meaning) {
  std::string text;
  parameters.Read("map_datum", text, meaning);
  if (text.empty()) return std::nullopt;
  geo::GeoPoint datum;
  int used = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf%n", &datum.latitude_deg, &datum.longitude_deg, &used) !=
          2 ||
      static_cast<std::size_t>(used) != text.size() || !geo::IsValid(datum)) {
    throw Error("parameter 'map_datum' is '" + text +
                "', accepted is LATITUDE,LONGITUDE in degrees, or nothing for " + otherwise);
  }
  return datum;
}

geometry_msgs::TransformStamped EarthFromMap(const geo::GeoPoint& datum,
                                             const std::string& map_frame, const ros::Time& stamp) {
  geometry_msgs::TransformStamped transform =
      tf2::eigenToTransform(geo::LocalFrame(datum).InEarth());
  transform.header.frame_id = "earth";
  transform.header.stamp = stamp;
  transform.child_frame_id = map_frame;
  return transform;
}

}  // namespace livemap::ros_io
