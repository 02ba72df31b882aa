#pragma once

#include <string>

#include "perception/privacy/privacy_mask.h"
#include "perception/tracking/object_tracker.h"
#include "ros/parameters/shared/parameter_reader.h"

namespace livemap::ros_io {

/// How objects are followed from image to image, and where the camera's motion comes from.
struct HazardTrackingConfig {
  bool tracking = true;  ///< Publish hazard/events.
  perception::ObjectTracker::Config tracker;
  std::string motion_frame = "odom";     ///< Frame in which the road stands still.
  std::string base_frame = "base_link";  ///< Frame at road level.
  double motion_max_age_s = 0.3;  ///< Of the newest pose, where that of the image is missing.
};

/// Defaults of the hazard_detection nodelet.
struct HazardDetectionConfig {
  std::string model;              ///< Path of the manifest; must be given.
  std::string engine = "auto";    ///< auto (the manifest's choice), opencv or torch.
  int engines = 2;                ///< Networks that work side by side on frames in turn.
  double all_views_hz = 16;       ///< Images a second that are looked at in all views; 0: all.
  int one_view_from_waiting = 1;  ///< Images that wait, from which on one look must do; 0: never.
  int threads = 1;                ///< Of each engine; OpenCV's are one pool; 0 = all cores.
  int queue_size = 4;             ///< Frames that may wait.
  bool annotate_empty = false;    ///< Publish the picture also when nothing was found.
  bool privacy = true;            ///< Mask faces and number plates in hazard/annotated.
  perception::PrivacyMask::Config mask;
  HazardTrackingConfig tracking;
  double max_stamp_ahead_s = 5.0;   ///< Of the clock: see StampGate::Config.
  double diagnostics_period_s = 1;  ///< s
};

/// Reads and checks all of them but `engine`; throws Error.
HazardDetectionConfig ReadHazardDetectionConfig(ParameterReader& parameters);

}  // namespace livemap::ros_io
