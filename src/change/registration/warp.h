#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "geo/camera_intrinsics.h"

namespace livemap::change {

/// The earlier picture in the later one's view.
struct WarpedPicture {
  cv::Mat picture;  ///< As the earlier picture; black where not valid.
  cv::Mat valid;    ///< CV_8UC1: 255 where the earlier picture shows what stands there, else 0.

  double ValidShare() const;
};

/// `before` of any 8-bit type; the result has its size.
WarpedPicture WarpByHomography(const cv::Mat& before, const cv::Matx33d& after_from_before);

/// Limits of WarpByDepth.
struct DepthWarpConfig {
  /// What lies this much further than the nearest thing on the same ray is hidden: share of the
  /// distance, and metres.
  double occlusion_share = 0.04;
  double occlusion_m = 0.2;
};

/// Each pixel of the later view is placed by its depth, seen from the earlier camera and taken from
/// there; a z-buffer of the earlier view says what was hidden from it. Not valid are pixels without
/// depth, beyond the earlier picture, or hidden. Sizes as in RegisterByDepth; Error otherwise.
WarpedPicture WarpByDepth(const cv::Mat& before, const geo::CameraIntrinsics& before_camera,
                          const cv::Mat& after_depth, const geo::CameraIntrinsics& after_camera,
                          const Eigen::Isometry3d& before_from_after,
                          const DepthWarpConfig& options = {});

}  // namespace livemap::change
