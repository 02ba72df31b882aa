#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "geo/wgs84.h"

namespace livemap::localization {

/// What is known of the satellite receiver. The error of a fix is taken as a part that neighbouring
/// fixes share and that wanders slowly, and a part that is new at every fix.
struct ReceiverModel {
  /// Antenna in base_link, x forward and y left, m.
  Eigen::Vector2d antenna_m = Eigen::Vector2d::Zero();
  /// The fix with stamp t says where the antenna was at t - latency_s, s.
  double latency_s = 0.08;
  /// How certain latency_s is, standard deviation, s; 0 keeps it as it is.
  double latency_sigma_s = 0.04;
  /// Standard deviation per axis of a fix whose receiver states none, m.
  double default_sigma_m = 2.0;
  /// No fix is believed to be better than this per axis, whatever it states, m: a receiver does not
  /// see its reflections.
  double min_sigma_m = 0;
  /// The shared part, standard deviation per axis, m; at most 0.8 of what the fix states.
  double shared_sigma_m = 1.0;
  /// After this time the shared part still correlates by 1/e, s.
  double shared_time_s = 60.0;
};

/// What is known of the odometry. Its scale and the bias of its yaw rate are estimated.
struct OdometryModel {
  /// Noise of the way, standard deviation after 1 m; grows with the root of the way, m.
  double way_sigma_m = 0.03;
  /// Noise of the heading, standard deviation after 1 s; grows with the root of time, rad.
  double yaw_sigma_rad = 0.001;
  /// The true way over the reported one differs from 1 by this, standard deviation; 0: it is 1.
  double scale_sigma = 0.02;
  /// How much the scale changes within 1 s, standard deviation.
  double scale_walk = 1e-4;
  /// The reported yaw rate less the true one, standard deviation, rad/s; 0: it has no bias.
  double yaw_bias_sigma_rps = 0.001;
  /// How much that bias changes within 1 s, standard deviation, rad/s.
  double yaw_bias_walk_rps = 2e-5;
  /// Faster is impossible, m/s.
  double max_speed_mps = 80.0;
  /// A step that leaves what the last speed foretells by more than this, and by more than
  /// 12 m/s^2 explain, is a reset, m.
  double max_jump_m = 1.0;
  /// Turning faster is impossible, rad/s.
  double max_yaw_rate_rps = 3.0;
  /// How wrong the last speed may be where a reset hides the way, standard deviation, m/s.
  double reset_speed_sigma_mps = 3.0;
  /// The same for the yaw rate, rad/s.
  double reset_yaw_rate_sigma_rps = 0.2;
};

/// Parameters of the localisation, with their defaults.
struct LocalizerConfig {
  /// Where the map's plane touches the ellipsoid; none: at the first fix.
  std::optional<geo::GeoPoint> datum;
  /// Fixes further than this from the datum are not believed: the plane ends there, m.
  double max_range_m = 100e3;
  /// Length of the window, s.
  double window_s = 30.0;
  /// Poses stand at least this far apart in the window, s.
  double node_spacing_s = 0.5;
  /// Without fixes a pose is set this often, s.
  double idle_spacing_s = 2.0;
  /// A fix whose squared Mahalanobis distance (two degrees of freedom) exceeds this is refused.
  double gate = 13.8;
  /// Where Cauchy's loss begins to doubt a fix, in standard deviations.
  double cauchy_scale = 2.4;
  /// Heading must be known this well before the map is fixed, standard deviation, rad.
  double start_yaw_sigma_rad = 0.05;
  /// So many fixes must agree for that.
  int start_fixes = 5;
  /// When most fixes have been refused for this long, the map is fixed anew by them, s.
  double restart_s = 10.0;
  /// Without a used fix for this long the state is dead reckoning, s.
  double dead_reckoning_s = 1.5;
  /// A pose is carried on beyond the newest odometry for at most this long, s.
  double max_extrapolation_s = 0.5;
  /// Steps of the optimisation per fix, at most.
  int max_iterations = 8;

  ReceiverModel receiver;
  OdometryModel odometry;
};

/// Throws Error naming the first value that is out of its range.
void Check(const LocalizerConfig& config);

}  // namespace livemap::localization
