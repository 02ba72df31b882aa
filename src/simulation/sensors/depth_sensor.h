#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "geo/camera_intrinsics.h"

namespace livemap::simulation {

/// How depth is measured.
enum class DepthSensor {
  kExact,   ///< As it is.
  kKinect,  ///< Structured light: steps of an eighth of a pixel, 0.5 to 10 m, holes at edges.
  kStereo,  ///< Matching of two pictures: noise grows with distance, holes where one camera is
            ///< blind.
  kRough,   ///< As kKinect, but edges bleed by up to three pixels instead of being holes, and there
            ///< are holes anywhere.
};

/// "exact", "kinect", "stereo", "rough"; none for anything else.
std::optional<DepthSensor> ParseDepthSensor(const std::string& name);

/// What a sensor makes of the depth `exact` (CV_32FC1 metres, 0: nothing); 0 where it sees nothing.
/// `baseline_m` is that of kStereo. Noise of a pixel depends on `seed` and its place only.
cv::Mat SenseDepth(const cv::Mat& exact, const geo::CameraIntrinsics& camera, DepthSensor sensor,
                   double baseline_m, std::uint32_t seed);

}  // namespace livemap::simulation
