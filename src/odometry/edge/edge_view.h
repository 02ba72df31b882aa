#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "geo/camera_intrinsics.h"
#include "odometry/edge/keyframe.h"

namespace livemap::odometry {

/// The keyframe's edge points drawn into a picture (CV_8UC3) of the image `grey` where it sees
/// them, near red to far blue: where they lie on its edges, the pose is right.
cv::Mat DrawEdges(const cv::Mat& grey, const Keyframe& keyframe,
                  const Eigen::Isometry3d& camera_from_keyframe,
                  const geo::CameraIntrinsics& intrinsics);

}  // namespace livemap::odometry
