#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "geo/camera_intrinsics.h"

namespace livemap::odometry {

/// Corners of one picture with what they look like.
struct PictureFeatures {
  std::vector<cv::Point2f> pixels;
  cv::Mat descriptors;  ///< One row each.
  bool found = false;   ///< Whether they were looked for.
  void Clear() {
    pixels.clear();
    descriptors.release();
    found = false;
  }
};

/// ORB features of a grey picture (CV_8UC1), at most 800.
void FindFeatures(const cv::Mat& grey, PictureFeatures& features);

/// The motion that most of the matched features agree on, P3P in RANSAC over those of the reference
/// with depth (CV_32FC1, m, 0 unknown); none when fewer than ten agree. It may be wide: nothing is
/// known beforehand. A proposal, not a pose: it errs by pixels. The same pictures give the same
/// motion.
std::optional<Eigen::Isometry3d> NewFromReferenceByFeatures(const PictureFeatures& reference,
                                                            const cv::Mat& reference_depth_m,
                                                            const PictureFeatures& picture,
                                                            const geo::CameraIntrinsics& camera);

}  // namespace livemap::odometry
