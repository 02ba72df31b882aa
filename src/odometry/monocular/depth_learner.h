#pragma once

#include <Eigen/Geometry>
#include <deque>
#include <opencv2/core.hpp>
#include <optional>

#include "odometry/edge/edge_extractor.h"
#include "odometry/monocular/corner_motion.h"
#include "odometry/monocular/inverse_depth_map.h"
#include "odometry/monocular/road_height.h"

namespace livemap::odometry {

/// What a keyframe without depth of its own has learnt, in units of the map.
struct LearntDepths {
  cv::Mat depth;                ///< CV_32FC1, 0 unknown: InverseDepthMap::DepthImage.
  cv::Mat inverse_depth_sigma;  ///< Same places: InverseDepthMap::SigmaImage.
  /// Of the camera over the road, where that was asked for.
  std::optional<RoadHeight> road_height{};
  /// Where corners contradict the motion from the last keyframe: the true camera, as the one that
  /// was said sees it.
  std::optional<Eigen::Isometry3d> said_from_true{};
};

/// Learns the inverse depths on the edges of one keyframe after another, from where the last
/// keyframes see them. Keeps its buffers; not thread-safe.
class DepthLearner {
 public:
  struct Config {
    EdgeExtractor::Config edges;
    InverseDepthMap::Config depth;
    /// Keyframes that a new one's depths are measured against, 1 to 100.
    int views_kept = 4;
    bool finds_road = false;  ///< Whether LearntDepths::road_height is looked for.
    RoadHeightMeter::Config road;
    CornerCheck::Config corners;
  };

  /// Throws Error when the configuration is wrong.
  DepthLearner(const Config& config, const geo::CameraIntrinsics& camera);

  /// Forgets everything. `smooth`, CV_8UC1, is the first view.
  void Restart(const cv::Mat& smooth, const Eigen::Isometry3d& world_from_camera);
  void Clear();

  /// Goes on to a new keyframe, which later ones are measured against. The depths that are looked
  /// for are those of the configuration in metres. `before`, an image from about one height of the
  /// camera behind, is for the road; it may be empty. The images are valid until the next call.
  LearntDepths Learn(const PosedImage& now, double metres_per_unit, const PosedImage& before);

  const InverseDepthMap& map() const { return map_; }

 private:
  Config config_;
  EdgeExtractor extractor_;
  InverseDepthMap map_;
  RoadHeightMeter road_;
  CornerCheck corners_;
  std::deque<PosedImage> views_;  // Keyframes, newest last: the present one.
};

}  // namespace livemap::odometry
