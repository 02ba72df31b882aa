#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "datasets/sequences.h"

namespace livemap::tools {

/// A picture of the camera's size, decoded with OpenCV's `flags`. Throws Error naming the file.
cv::Mat ReadPicture(const std::string& path, const geo::CameraIntrinsics& camera, int flags);

/// The sequence's camera; one without width and height has those of the first picture.
geo::CameraIntrinsics IntrinsicsOf(const datasets::Sequence& sequence);

}  // namespace livemap::tools
