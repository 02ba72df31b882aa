#pragma once

#include <array>
#include <opencv2/core.hpp>

#include "odometry/edge/edge_extractor.h"
#include "odometry/edge/image_pyramid.h"
#include "odometry/edge/keyframe.h"
#include "odometry/edge/point_selector.h"

namespace livemap::odometry {

/// Chooses the points of a keyframe that later frames are aligned with, on each level of its
/// pyramid. A keyframe whose points lie in few parts of its picture takes those under faint edges,
/// too. Keeps its buffers; not thread-safe.
class KeyframePointSelector {
 public:
  struct Config {
    EdgeExtractor::Config edges;
    PointSelection points;                   ///< Its max_points is taken from the next.
    std::array<int, kMaxLevels> max_points;  ///< Per level, finest first.
  };

  KeyframePointSelector(const Config& config, const LevelCameras& cameras);

  /// Memory for pictures of this size.
  void Reserve(const cv::Size& size);

  /// Fills in the keyframe's points, its thumbnail's, and its finest level, from its images and
  /// depths.
  void Select(Keyframe& keyframe);

  /// The points of a level that lie under the edges of another picture (thesis, equation 5.2) if
  /// that has the keyframe's pose; valid until the next call.
  const EdgePoints& SelectUnder(const cv::Mat& grey, const Keyframe& keyframe, int level);

 private:
  double SelectLevel(int level, Keyframe& keyframe);
  PointSelection SelectionOf(int level) const;

  Config config_;
  LevelCameras cameras_;
  EdgeExtractor extractor_, faint_extractor_;
  PointSelector selector_;
  EdgePoints masked_points_;
};

}  // namespace livemap::odometry
