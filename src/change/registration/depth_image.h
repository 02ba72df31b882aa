#pragma once

#include <opencv2/core.hpp>

namespace livemap::change {

/// Throws Error when a depth image is not CV_32FC1 of `size`.
void CheckDepthImage(const cv::Mat& depth, cv::Size size);

}  // namespace livemap::change
