#pragma once

#include <optional>
#include <string>
#include <vector>

#include "datasets/camera_file.h"
#include "evaluation/detection/detection_metrics.h"
#include "perception/tracking/object_tracker.h"

namespace livemap::evaluation {

/// How a labelled drive is played to the tracker.
struct TrackedDriveConfig {
  /// None: the tracker knows no motion.
  std::optional<datasets::CameraFile> camera;
  double speed_mps = 16;  ///< Makes stamps of chainage.
};

/// What the tracker gets of a drive's frame at `chainage_m`: the vehicle drives straight on by its
/// chainage. `last_ns` is the stamp of the frame before, which this one is always after.
perception::TrackerFrame ToTrackerFrame(std::vector<perception::HazardDetection> detections,
                                        cv::Size image_size, double chainage_m,
                                        std::int64_t last_ns, const TrackedDriveConfig& options);

/// The drive with the tracker's events of one class, at their best views and scored by their
/// evidence, in place of its detections. `frames` are those of `labelled`, one for one.
ScoredDrive EventsOfDrive(const ScoredDrive& labelled,
                          const std::vector<perception::TrackerFrame>& frames,
                          const std::string& class_name, perception::ObjectTracker tracker);

}  // namespace livemap::evaluation
