#include "ros/parameters/positioning/geo_localization_parameters.h"

#include "ros/parameters/shared/datum_parameter.h"
#include "ros/parameters/shared/shared_parameters.h"

namespace livemap::ros_io {
namespace {

// The localizer checks its own settings, too, for programs that have no parameters: the ranges are
// those of Check, localization/localizer_config.h; parameters_test compares them.

void ReadLocalizationEstimation(ParameterReader& parameters, GeoLocalizationConfig& config) {
  localization::LocalizerConfig& localizer = config.localizer;
  parameters.Section("Estimation");
  parameters.Read("window_s", localizer.window_s, {2, 300},
                  "Length of the window that is optimised.", "s");
  parameters.Read("node_spacing_s", localizer.node_spacing_s, {0.05, 5},
                  "Least time between two poses of the window.", "s");
  parameters.Read("idle_spacing_s", localizer.idle_spacing_s, {0.05, 10},
                  "Without fixes a pose is set this often. At least node_spacing_s.", "s");
  parameters.Read("gate", localizer.gate, {1, 1000},
                  "A fix whose squared Mahalanobis distance exceeds this is refused (2 degrees of "
                  "freedom: 99.9 %).");
  parameters.Read("cauchy_scale", localizer.cauchy_scale, {0.1, 100},
                  "Residual at which the robust loss begins to doubt a fix.",
                  "standard deviations");
  parameters.Read("start_yaw_sigma_rad", localizer.start_yaw_sigma_rad, {0.005, 0.5},
                  "The map is fixed when the heading is known this well (standard deviation) and "
                  "start_fixes fixes agree.",
                  "rad");
  parameters.Read("start_fixes", localizer.start_fixes, {3, 100},
                  "Number of fixes that must agree before the map is fixed.");
  parameters.Read("restart_s", localizer.restart_s, {1, 1000},
                  "When most fixes have been refused for so long, they fix the map anew.", "s");
  parameters.Read("dead_reckoning_s", localizer.dead_reckoning_s, {0.1, 100},
                  "Without a used fix for so long the state is dead reckoning.", "s");
  parameters.Read("max_extrapolation_s", localizer.max_extrapolation_s, {0, 5},
                  "A pose is carried beyond the newest odometry for at most this long.", "s");
  parameters.Read("max_iterations", localizer.max_iterations, {1, 100},
                  "Most steps of the optimisation per fix.");
  parameters.Read("order_wait_s", config.feed.order_wait_s, {0, 5},
                  "Longest wait for the order of stamps, by the wall clock: odometry waits so long "
                  "for a fix of its moment, and a fix for such odometry. Messages within it give "
                  "the same poses in each replay.",
                  "s");
}

void ReadLocalizationReceiver(ParameterReader& parameters, localization::ReceiverModel& receiver) {
  parameters.Section("Receiver");
  parameters.Read("antenna_x_m", receiver.antenna_m.x(), {-50, 50},
                  "Place of the receiver's antenna in base_link, forward.", "m");
  parameters.Read("antenna_y_m", receiver.antenna_m.y(), {-50, 50},
                  "Place of the receiver's antenna in base_link, to the left.", "m");
  parameters.Read(
      "latency_s", receiver.latency_s, {0, 2},
      "A fix with stamp t says where the antenna was at t - latency_s. The default suits a 10 Hz "
      "receiver whose fixes are stamped on arrival. A receiver that stamps the moment of its "
      "measurement, as simulated ones do, needs 0 here and in latency_sigma_s.",
      "s");
  parameters.Read("latency_sigma_s", receiver.latency_sigma_s, {0, 1},
                  "Standard deviation of latency_s; 0: the latency is not estimated.", "s");
  parameters.Read("default_sigma_m", receiver.default_sigma_m, {0.01, 100},
                  "Standard deviation per axis of a fix that states none.", "m");
  parameters.Renamed("least_sigma_m", "min_sigma_m");
  parameters.Read("min_sigma_m", receiver.min_sigma_m, {0, 100},
                  "Least standard deviation per axis that a fix is given, whatever it states: a "
                  "receiver does not see its reflections. In streets between houses 1.5, with "
                  "shared_time_s 5, is nearer to the truth.",
                  "m");
  parameters.Read("shared_sigma_m", receiver.shared_sigma_m, {0, 100},
                  "The part of a fix's error that neighbouring fixes share: standard deviation per "
                  "axis; at most 0.8 of the stated standard deviation counts.",
                  "m");
  parameters.Read("shared_time_s", receiver.shared_time_s, {1, 1e5},
                  "Time after which that shared part correlates by 1/e.", "s");
}

void ReadLocalizationOdometry(ParameterReader& parameters, GeoLocalizationConfig& config) {
  localization::OdometryModel& odometry = config.localizer.odometry;
  parameters.Section("Odometry");
  parameters.ReadChoice(
      "odometry_covariance", config.odometry_covariance, {"model", "message"},
      "Source of the covariance of an odometry step: model (way_sigma_m and yaw_sigma_rad) or "
      "message (the twist's covariance times the square of the time).");
  parameters.Read("way_sigma_m", odometry.way_sigma_m, {1e-4, 10},
                  "Noise of the distance after 1 m, standard deviation; it grows with the root. "
                  "Counts where a step brings no covariance of its own.",
                  "m");
  parameters.Read("yaw_sigma_rad", odometry.yaw_sigma_rad, {1e-5, 1},
                  "Noise of the heading after 1 s, standard deviation; it grows with the root. "
                  "Counts where a step brings no covariance of its own.",
                  "rad");
  parameters.Read(
      "scale_sigma", odometry.scale_sigma, {0, 0.5},
      "True over reported distance minus 1, standard deviation; 0: the scale is not estimated.");
  parameters.Read("scale_walk", odometry.scale_walk, {0, 0.1},
                  "Change of the scale within 1 s, standard deviation.");
  parameters.Read("yaw_bias_sigma_rps", odometry.yaw_bias_sigma_rps, {0, 0.5},
                  "Bias of the yaw rate, standard deviation; 0: the bias is not estimated.",
                  "rad/s");
  parameters.Read("yaw_bias_walk_rps", odometry.yaw_bias_walk_rps, {0, 0.1},
                  "Change of the bias of the yaw rate within 1 s, standard deviation.", "rad/s");
  parameters.Read("max_speed_mps", odometry.max_speed_mps, {1, 400},
                  "Odometry faster than this is a reset.", "m/s");
  parameters.Read("max_jump_m", odometry.max_jump_m, {0.01, 100},
                  "A step that differs from the last speed by more than this, and by more than 12 "
                  "m/s^2 explain, is a reset.",
                  "m");
  parameters.Read("max_yaw_rate_rps", odometry.max_yaw_rate_rps, {0.1, 100},
                  "Odometry that turns faster than this is a reset.", "rad/s");
  parameters.Read("reset_speed_sigma_mps", odometry.reset_speed_sigma_mps, {0.1, 100},
                  "Error of the last speed, which bridges a reset, standard deviation.", "m/s");
  parameters.Read("reset_yaw_rate_sigma_rps", odometry.reset_yaw_rate_sigma_rps, {0.01, 10},
                  "Error of the last yaw rate, which bridges a reset, standard deviation.",
                  "rad/s");
}

}  // namespace

GeoLocalizationConfig ReadGeoLocalizationConfig(ParameterReader& parameters) {
  GeoLocalizationConfig config;
  localization::LocalizerConfig& localizer = config.localizer;
  parameters.Section("Map");
  localizer.datum = ReadDatum(parameters, "the first fix with which others agree",
                              "Origin of the map, \"LATITUDE,LONGITUDE\" in degrees: the map is "
                              "the east-north-up plane that touches the ellipsoid there; empty: "
                              "the first fix with which others agree. tf earth -> map tells the "
                              "other nodes.");
  parameters.Read("max_range_m", localizer.max_range_m, {1, 300e3},
                  "Fixes further than this from the datum are refused.", "m");
  ReadLocalizationEstimation(parameters, config);
  ReadLocalizationReceiver(parameters, localizer.receiver);
  ReadLocalizationOdometry(parameters, config);
  parameters.Section("Topics and frames");
  parameters.Read("map_frame", config.map_frame, "Frame of the map, after REP 105.");
  parameters.Read("odom_frame", config.odom_frame,
                  "Frame of the odometry, after REP 105; odometry of other frames is dropped.");
  parameters.Read("base_frame", config.base_frame,
                  "Frame of the vehicle, after REP 105; odometry of other frames is dropped.");
  parameters.Read("publish_tf", config.publish_tf,
                  "Whether tf map -> odom and the static earth -> map are published.");
  parameters.Read("silence_warning_s", config.silence_warning_s, {0.1, 3600},
                  "Without fixes or without odometry for so long, the log says which is missing.",
                  "s");
  ReadStampLimit(parameters, config.feed.stamps.max_ahead_s);
  ReadDiagnosticsPeriod(parameters, config.diagnostics_period_s);
  parameters.RejectUnknown({"diagnostic_period"});  // diagnostic_updater's own.
  return config;
}

}  // namespace livemap::ros_io
