#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "change/objects/change_detector.h"
#include "ros/parameters/shared/parameter_reader.h"
#include "ros/parameters/shared/shared_parameters.h"
#include "vehicle/positioning/vehicle_pose_lookup.h"

namespace livemap::ros_io {

/// Defaults of the change_detection nodelet; the reader states their meanings.
struct ChangeDetectionConfig {
  std::string method = "network";  ///< network, dense-sift or daisy.
  std::string model;               ///< Path of the network's manifest.
  double threshold = -1;           ///< Least probability of change; below 0: the manifest's.
  int threads = 2;                 ///< Of OpenCV, whose pool is one for the process; 0: as it is.
  double spacing_m = 1.0;          ///< Of road between two images that are looked at.
  int width_px = 640;              ///< Wider images are scaled down to this.
  int max_waiting_frames = 30;     ///< Images that wait for their position.
  std::string base_frame = "base_link";
  std::string map_frame = "map";  ///< Of fused poses.
  bool use_depth = false;         ///< Of camera/depth/image_raw.
  double depth_wait_s = 0.3;
  double depth_units_per_m = 1000;  ///< Of 16-bit depth (REP 118).
  bool tell_zone = true;            ///< Objects that were passed, as MapChange.
  double tell_confidence = 0.5;     ///< Least, of these.
  ZoneParameters zones;
  double diagnostics_period_s = 1.0;
  change::ChangeDetector::Config watch;
  vehicle::VehiclePoseLookup::Config pose;
};

/// Reads and checks all of them; throws Error. `now_ns` names the drive when no parameter does.
ChangeDetectionConfig ReadChangeDetectionConfig(ParameterReader& parameters, std::int64_t now_ns);

/// What compares, with its name, and the threshold that counts.
struct ConfiguredChangeMethod {
  std::unique_ptr<change::ChangeMethod> method;
  std::string name;
  double threshold = 0.5;
};

/// Throws Error, also when the network cannot be loaded.
ConfiguredChangeMethod MakeConfiguredMethod(const ChangeDetectionConfig& config);

}  // namespace livemap::ros_io
