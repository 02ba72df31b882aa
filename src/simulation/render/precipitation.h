#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "geo/camera_intrinsics.h"
#include "simulation/render/lighting.h"

namespace livemap::simulation {

/// Draws falling rain or snow of the weather between the camera and the street into linear light
/// (CV_32FC3). Each frame has its own drops; `depth` (metres, 0: sky) hides those behind bodies.
void AddPrecipitation(const Lighting& lighting, const geo::CameraIntrinsics& camera,
                      std::uint32_t frame_number, const cv::Mat& depth, cv::Mat& light);

}  // namespace livemap::simulation
