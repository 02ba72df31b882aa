#include "localization/localizer_config.h"

#include <cmath>
#include <sstream>
#include <string>

#include "common/error.h"

namespace livemap::localization {
namespace {

void CheckLocalizerRange(const char* name, double value, double min, double max) {
  if (value >= min && value <= max) return;
  std::ostringstream sentence;
  sentence << "localisation: '" << name << "' is " << value << ", accepted is a number from " << min
           << " to " << max;
  throw Error(sentence.str());
}

void Check(const ReceiverModel& receiver) {
  CheckLocalizerRange("antenna_x_m", receiver.antenna_m.x(), -50, 50);
  CheckLocalizerRange("antenna_y_m", receiver.antenna_m.y(), -50, 50);
  CheckLocalizerRange("latency_s", receiver.latency_s, 0, 2);
  CheckLocalizerRange("latency_sigma_s", receiver.latency_sigma_s, 0, 1);
  CheckLocalizerRange("default_sigma_m", receiver.default_sigma_m, 0.01, 100);
  CheckLocalizerRange("min_sigma_m", receiver.min_sigma_m, 0, 100);
  CheckLocalizerRange("shared_sigma_m", receiver.shared_sigma_m, 0, 100);
  CheckLocalizerRange("shared_time_s", receiver.shared_time_s, 1, 1e5);
}

void Check(const OdometryModel& odometry) {
  CheckLocalizerRange("way_sigma_m", odometry.way_sigma_m, 1e-4, 10);
  CheckLocalizerRange("yaw_sigma_rad", odometry.yaw_sigma_rad, 1e-5, 1);
  CheckLocalizerRange("scale_sigma", odometry.scale_sigma, 0, 0.5);
  CheckLocalizerRange("scale_walk", odometry.scale_walk, 0, 0.1);
  CheckLocalizerRange("yaw_bias_sigma_rps", odometry.yaw_bias_sigma_rps, 0, 0.5);
  CheckLocalizerRange("yaw_bias_walk_rps", odometry.yaw_bias_walk_rps, 0, 0.1);
  CheckLocalizerRange("max_speed_mps", odometry.max_speed_mps, 1, 400);
  CheckLocalizerRange("max_jump_m", odometry.max_jump_m, 0.01, 100);
  CheckLocalizerRange("max_yaw_rate_rps", odometry.max_yaw_rate_rps, 0.1, 100);
  CheckLocalizerRange("reset_speed_sigma_mps", odometry.reset_speed_sigma_mps, 0.1, 100);
  CheckLocalizerRange("reset_yaw_rate_sigma_rps", odometry.reset_yaw_rate_sigma_rps, 0.01, 10);
}

}  // namespace

void Check(const LocalizerConfig& config) {
  if (config.datum) geo::LocalFrame{*config.datum};  // Throws by itself.
  CheckLocalizerRange("max_range_m", config.max_range_m, 1, 300e3);
  CheckLocalizerRange("window_s", config.window_s, 2, 300);
  CheckLocalizerRange("node_spacing_s", config.node_spacing_s, 0.05, 5);
  CheckLocalizerRange("idle_spacing_s", config.idle_spacing_s, config.node_spacing_s, 10);
  CheckLocalizerRange("gate", config.gate, 1, 1000);
  CheckLocalizerRange("cauchy_scale", config.cauchy_scale, 0.1, 100);
  CheckLocalizerRange("start_yaw_sigma_rad", config.start_yaw_sigma_rad, 0.005, 0.5);
  CheckLocalizerRange("start_fixes", config.start_fixes, 3, 100);
  CheckLocalizerRange("restart_s", config.restart_s, 1, 1000);
  CheckLocalizerRange("dead_reckoning_s", config.dead_reckoning_s, 0.1, 100);
  CheckLocalizerRange("max_extrapolation_s", config.max_extrapolation_s, 0, 5);
  CheckLocalizerRange("max_iterations", config.max_iterations, 1, 100);
  Check(config.receiver);
  Check(config.odometry);
}

}  // namespace livemap::localization
