#pragma once

#include <string>

#include "localization/localizer_feed.h"
#include "ros/parameters/shared/parameter_reader.h"

namespace livemap::ros_io {

/// Defaults of the geo_localization nodelet; the reader states their meanings.
struct GeoLocalizationConfig {
  localization::LocalizerConfig localizer;
  localization::LocalizerFeed::Config feed;
  /// Whose covariance of a step counts: "model" (the parameters) or "message" (the twist's).
  std::string odometry_covariance = "model";
  std::string map_frame = "map";
  std::string odom_frame = "odom";
  std::string base_frame = "base_link";
  bool publish_tf = true;          ///< map_frame -> odom_frame and earth -> map_frame.
  double silence_warning_s = 5.0;  ///< Without fixes or odometry for so long, it says so.
  double diagnostics_period_s = 1.0;
};

/// Reads and checks all of them; throws Error.
GeoLocalizationConfig ReadGeoLocalizationConfig(ParameterReader& parameters);

}  // namespace livemap::ros_io
