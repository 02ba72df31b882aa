#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "datasets/sequences.h"

namespace livemap::tools {

/// A colour picture (CV_8UC3) of the camera's size, upright. Throws Error naming the file.
cv::Mat ReadColourPicture(const std::string& path, const geo::CameraIntrinsics& camera);

/// A depth image (CV_16UC1) of the camera's size. Throws Error naming the file.
cv::Mat ReadDepthPicture(const std::string& path, const geo::CameraIntrinsics& camera);

/// The sequence's camera; one without width and height has those of the first picture.
geo::CameraIntrinsics IntrinsicsOf(const datasets::Sequence& sequence);

}  // namespace livemap::tools
