#pragma once

#include <algorithm>
#include <opencv2/core.hpp>

namespace livemap::simulation {

/// Whether two images have the same size, type and bytes.
inline bool SamePixels(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() &&
         std::equal(a.datastart, a.dataend, b.datastart);
}

}  // namespace livemap::simulation
