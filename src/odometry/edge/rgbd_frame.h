#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "geo/camera_intrinsics.h"

namespace livemap::odometry {

/// One image with its depth.
struct RgbdFrame {
  std::int64_t stamp_ns = 0;
  cv::Mat grey;   ///< CV_8UC1, rectified.
  cv::Mat depth;  ///< CV_16UC1 in 1/units_per_m or CV_32FC1 in m, registered to `grey`; or empty.
  double depth_units_per_m = 1000;
};

/// The camera itself; throws Error when its focal lengths or principal point are no usable numbers
/// or its size is not 32x32 to 8192x8192 pixels.
const geo::CameraIntrinsics& CheckedCamera(const geo::CameraIntrinsics& camera);

/// Throws Error unless the frame's image, and its depth if there is one, have the camera's size, an
/// accepted type and, for depth, a unit.
void CheckPictures(const RgbdFrame& frame, const geo::CameraIntrinsics& camera);

}  // namespace livemap::odometry
