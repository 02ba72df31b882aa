#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace livemap::tools {

/// Pictures of one size side by side on dark ground, `columns` per row; CV_8UC3.
cv::Mat ContactSheet(const std::vector<cv::Mat>& pictures, int columns);

}  // namespace livemap::tools
