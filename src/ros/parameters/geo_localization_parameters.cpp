#include "ros/parameters/geo_localization_parameters.h"

#include "ros/parameters/datum_parameter.h"

namespace livemap::ros_io {
namespace {

// The localizer's own check knows the ranges: Check, localization/localizer_config.h.

void ReadReceiver(ParameterReader& parameters, localization::ReceiverModel& receiver) {
  parameters.Read("antenna_x_m", receiver.antenna_m.x());
  parameters.Read("antenna_y_m", receiver.antenna_m.y());
  parameters.Read("latency_s", receiver.latency_s);
  parameters.Read("latency_sigma_s", receiver.latency_sigma_s);
  parameters.Read("default_sigma_m", receiver.default_sigma_m);
  parameters.Read("least_sigma_m", receiver.min_sigma_m);
  parameters.Read("shared_sigma_m", receiver.shared_sigma_m);
  parameters.Read("shared_time_s", receiver.shared_time_s);
}

void ReadOdometry(ParameterReader& parameters, localization::OdometryModel& odometry) {
  parameters.Read("way_sigma_m", odometry.way_sigma_m);
  parameters.Read("yaw_sigma_rad", odometry.yaw_sigma_rad);
  parameters.Read("scale_sigma", odometry.scale_sigma);
  parameters.Read("scale_walk", odometry.scale_walk);
  parameters.Read("yaw_bias_sigma_rps", odometry.yaw_bias_sigma_rps);
  parameters.Read("yaw_bias_walk_rps", odometry.yaw_bias_walk_rps);
  parameters.Read("max_speed_mps", odometry.max_speed_mps);
  parameters.Read("max_jump_m", odometry.max_jump_m);
  parameters.Read("max_yaw_rate_rps", odometry.max_yaw_rate_rps);
  parameters.Read("reset_speed_sigma_mps", odometry.reset_speed_sigma_mps);
  parameters.Read("reset_yaw_rate_sigma_rps", odometry.reset_yaw_rate_sigma_rps);
}

}  // namespace

GeoLocalizationConfig ReadGeoLocalizationConfig(ParameterReader& parameters) {
  GeoLocalizationConfig config;
  localization::LocalizerConfig& localizer = config.localizer;
  localizer.datum = ReadDatum(parameters, "the first fix");
  parameters.Read("max_range_m", localizer.max_range_m);
  parameters.Read("window_s", localizer.window_s);
  parameters.Read("node_spacing_s", localizer.node_spacing_s);
  parameters.Read("idle_spacing_s", localizer.idle_spacing_s);
  parameters.Read("gate", localizer.gate);
  parameters.Read("cauchy_scale", localizer.cauchy_scale);
  parameters.Read("start_yaw_sigma_rad", localizer.start_yaw_sigma_rad);
  parameters.Read("start_fixes", localizer.start_fixes);
  parameters.Read("restart_s", localizer.restart_s);
  parameters.Read("dead_reckoning_s", localizer.dead_reckoning_s);
  parameters.Read("max_extrapolation_s", localizer.max_extrapolation_s);
  parameters.Read("max_iterations", localizer.max_iterations);
  ReadReceiver(parameters, localizer.receiver);
  ReadOdometry(parameters, localizer.odometry);
  parameters.Read("order_wait_s", config.feed.order_wait_s, {0, 5});
  parameters.ReadChoice("odometry_covariance", config.odometry_covariance, {"model", "message"});
  parameters.Read("map_frame", config.map_frame);
  parameters.Read("odom_frame", config.odom_frame);
  parameters.Read("base_frame", config.base_frame);
  parameters.Read("publish_tf", config.publish_tf);
  parameters.Read("silence_warning_s", config.silence_warning_s, {0.1, 3600});
  parameters.Read("diagnostics_period_s", config.diagnostics_period_s, {0.05, 60});
  parameters.RejectUnknown({"diagnostic_period"});  // diagnostic_updater's own.
  return config;
}

}  // namespace livemap::ros_io
