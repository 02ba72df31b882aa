#include "odometry/monocular/depth_learner.h"

#include <string>
#include <utility>

#include "common/error.h"

namespace livemap::odometry {

DepthLearner::DepthLearner(const Config& config, const geo::CameraIntrinsics& camera)
    : config_(config),
      extractor_(config.edges),
      map_(config.depth, camera),
      road_(config.road, camera),
      corners_(config.corners, camera) {
  if (config.views_kept < 1 || config.views_kept > 100) {
    throw Error("views_kept is " + std::to_string(config.views_kept) + "; 1 to 100 is accepted");
  }
}

void DepthLearner::Clear() {
  views_.clear();
  map_.Clear();
  road_.Reset();
}

void DepthLearner::Restart(const cv::Mat& smooth, const Eigen::Isometry3d& world_from_camera) {
  Clear();
  views_.push_back({smooth.clone(), world_from_camera});
}

/// From the last keyframes' depths and from where the earlier keyframes see the new edges: the
/// newest view, which is the nearest, first.
LearntDepths DepthLearner::Learn(const PosedImage& said, double metres_per_unit,
                                 const PosedImage& before) {
  LearntDepths learnt;
  PosedImage now = said;
  const PosedImage& last = views_.back();
  // The first motion is of corners itself, and verified by more of them.
  std::optional<Eigen::Isometry3d> now_from_last;
  if (views_.size() > 1) {
    now_from_last = corners_.Contradicting(
        last.smooth, now.smooth, now.world_from_camera.inverse() * last.world_from_camera);
  }
  if (now_from_last) {
    now.world_from_camera = last.world_from_camera * now_from_last->inverse();
    learnt.said_from_true = said.world_from_camera.inverse() * now.world_from_camera;
  }
  map_.SetRange(static_cast<double>(config_.depth.min_depth_m) / metres_per_unit,
                static_cast<double>(config_.depth.max_depth_m) / metres_per_unit);
  map_.MoveTo(extractor_.Extract(now.smooth),
              now.world_from_camera.inverse() * views_.back().world_from_camera);
  for (auto view = views_.rbegin(); view != views_.rend(); ++view) {
    map_.Measure(now.smooth, view->smooth,
                 view->world_from_camera.inverse() * now.world_from_camera,
                 view == views_.rbegin());
  }
  map_.Regularise();
  if (config_.finds_road && !before.smooth.empty() && !now_from_last) {
    learnt.road_height = road_.Measure(now, before, map_.edges());
  }
  if (views_.size() >= static_cast<std::size_t>(config_.views_kept)) {
    views_.push_back(std::move(views_.front()));  // Its memory serves again.
    views_.pop_front();
  } else {
    views_.emplace_back();
  }
  now.smooth.copyTo(views_.back().smooth);
  views_.back().world_from_camera = now.world_from_camera;
  learnt.depth = map_.DepthImage();
  learnt.inverse_depth_sigma = map_.SigmaImage();
  return learnt;
}

}  // namespace livemap::odometry
