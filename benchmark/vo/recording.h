#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "datasets/sequences.h"
#include "odometry/edge/edge_odometry.h"

namespace livemap::bench {

/// An RGB-D sequence that methods are measured on. Frames are decoded one by one, outside of what
/// is timed.
class Recording {
 public:
  /// Reads the lists of a TUM folder and keeps the first `max_frames` frames; `camera_file` as
  /// ReadTumSequence's. Throws Error, also when there is no depth.
  Recording(const std::string& directory, const std::string& camera_file, std::size_t max_frames);

  std::size_t size() const { return sequence_.frames.size(); }
  const geo::CameraIntrinsics& camera() const { return camera_; }
  const std::vector<datasets::StampedPose>& truth() const { return sequence_.poses; }

  /// CV_8UC3 as it is in the file.
  cv::Mat ReadColour(std::size_t index) const;
  /// The frame with its depth; `grey` is left empty for whoever times the conversion.
  odometry::RgbdFrame ReadDepth(std::size_t index) const;
  /// Both, grey.
  odometry::RgbdFrame Read(std::size_t index) const;
  std::vector<odometry::RgbdFrame> ReadAll() const;
  /// The true pose nearest to the picture's stamp, less than 0.02 s away.
  std::optional<Eigen::Isometry3d> TruthAt(std::size_t index) const;

 private:
  datasets::Sequence sequence_;
  geo::CameraIntrinsics camera_;
  std::vector<std::optional<Eigen::Isometry3d>> truth_at_;
};

/// What one method made of a recording.
struct MethodRun {
  std::vector<datasets::StampedPose> trajectory;
  std::vector<double> milliseconds;  ///< Per frame, ThreadTimeMs.
  std::size_t lost = 0;
  std::size_t keyframes = 0;
};

/// Errors (null without truth or with too little of it), time, lost frames and keyframes.
nlohmann::ordered_json FiguresOf(const std::vector<datasets::StampedPose>& truth,
                                 const MethodRun& run);

/// Everything about a recording that does not depend on the method.
nlohmann::ordered_json DescriptionOf(const Recording& recording);

}  // namespace livemap::bench
