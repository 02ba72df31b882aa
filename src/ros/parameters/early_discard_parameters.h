#pragma once

#include <cstdint>
#include <string>

#include "perception/privacy/privacy_mask.h"
#include "ros/parameters/shared/parameter_reader.h"
#include "vehicle/reporting/offload_sender.h"

namespace livemap::ros_io {

/// Defaults of the small vehicle's early_discard nodelet; the reader states their meanings.
struct EarlyDiscardConfig {
  std::string model;      ///< Path of the classifier's manifest; must be given.
  double threshold = -1;  ///< Least score that is sent; below 0: the manifest's.
  int threads = 1;        ///< Of OpenCV, whose pool is one for the process; 0 = all cores.
  int queue_size = 2;     ///< Frames that may wait for the classifier.
  vehicle::OffloadSender::Config sender;
  int jpeg_quality = 75;  ///< 1..100; lowered where the bytes do not suffice.
  bool privacy = true;    ///< Mask faces and number plates.
  perception::PrivacyMask::Config mask;
  std::string base_frame = "base_link";
  std::string map_frame = "map";  ///< Of fused poses.
  double diagnostics_period_s = 1.0;
};

/// Reads and checks all of them; throws Error. `now_ns` names the drive when no parameter does.
EarlyDiscardConfig ReadEarlyDiscardConfig(ParameterReader& parameters, std::int64_t now_ns);

}  // namespace livemap::ros_io
