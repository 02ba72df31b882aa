#pragma once

#include <string>

#include "odometry/edge/edge_odometry.h"
#include "ros/parameters/shared/parameter_reader.h"

namespace livemap::ros_io {

/// Defaults of the edge_vo nodelet; the reader states their meanings.
struct EdgeVoConfig {
  odometry::EdgeOdometry::Config odometry;
  std::string eye = "auto";  ///< "auto", "depth" or "mono".
  double eye_wait_s = 0.5;   ///< Of auto: images without depth for so long mean that there is none.
  bool background_keyframes = true;  ///< Of one eye.
  std::string wheel_velocity_topic;  ///< Empty: none.
  double wheel_sigma_mps = 0.1;      ///< Where a message states none.
  double receiver_sigma_mps = 0.2;   ///< Where a message states none.
  bool calibrate_mounting = true;
  std::string mounting_file;          ///< Empty: nothing is kept.
  double mounting_sigma_rad = 0.035;  ///< Of tf's mounting.
  double mounting_sigma_m = 0.05;
  bool publish_mounting = true;     ///< On tf.
  std::string sync = "exact";       ///< "exact" or "approximate".
  int queue_size = 10;              ///< Messages that may wait for their partners.
  int waiting_frames = 4;           ///< Frames that may wait while one is followed.
  double depth_units_per_m = 1000;  ///< Of 16-bit depth (REP 118).
  std::string odom_frame = "odom";
  std::string base_frame = "base_link";
  bool publish_tf = true;  ///< odom -> base_link.
  double path_spacing_m = 0.1;
  int path_max_poses = 10000;
  double cloud_voxel_m = 0.05;     ///< 0: every point.
  double silence_warning_s = 5.0;  ///< Without a synchronised frame for so long, it says why.
  double max_stamp_ahead_s = 5.0;  ///< Of the clock: see StampGate::Config.
  double diagnostics_period_s = 1.0;
};

/// Reads and checks all of them; throws Error.
EdgeVoConfig ReadEdgeVoConfig(ParameterReader& parameters);

}  // namespace livemap::ros_io
