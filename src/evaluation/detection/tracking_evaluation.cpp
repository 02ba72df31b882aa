#include "evaluation/detection/tracking_evaluation.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace livemap::evaluation {

perception::TrackerFrame ToTrackerFrame(std::vector<perception::HazardDetection> detections,
                                        cv::Size image_size, double chainage_m,
                                        std::int64_t last_ns, const TrackedDriveConfig& options) {
  constexpr std::int64_t kMinStepNs = 1'000'000;  // frames may share a rounded chainage
  perception::TrackerFrame frame;
  frame.stamp_ns = std::max(last_ns + kMinStepNs,
                            std::int64_t{std::llround(chainage_m / options.speed_mps * 1e9)});
  frame.image_size = image_size;
  frame.detections = std::move(detections);
  if (options.camera) {
    perception::CameraMotion motion;
    motion.intrinsics = options.camera->intrinsics;
    motion.base_from_optical = options.camera->mounting.BaseFromOptical();
    motion.world_from_base.translation().x() = chainage_m;
    frame.motion = motion;
  }
  return frame;
}

ScoredDrive EventsOfDrive(const ScoredDrive& labelled,
                          const std::vector<perception::TrackerFrame>& frames,
                          const std::string& class_name, perception::ObjectTracker tracker) {
  ScoredDrive drive = labelled;
  std::map<std::int64_t, std::size_t> by_stamp;
  for (std::size_t i = 0; i < drive.size(); ++i) {
    drive[i].detections.clear();
    by_stamp[frames[i].stamp_ns] = i;
  }
  const auto keep = [&](const std::vector<perception::ObjectEvent>& events) {
    for (const perception::ObjectEvent& event : events) {
      if (event.detection.class_name != class_name) continue;
      drive[by_stamp.at(event.stamp_ns)].detections.push_back(
          {event.detection.box, static_cast<float>(event.evidence)});
    }
  };
  for (const perception::TrackerFrame& frame : frames) keep(tracker.Add(frame));
  keep(tracker.Finish());
  return drive;
}

}  // namespace livemap::evaluation
