#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace livemap::odometry {

/// Grey value between pixels of a CV_8UC1 image. Requires 0 <= `u` < columns - 1 and the same of
/// `v` and the rows.
inline float Interpolate(const cv::Mat& grey, float u, float v) {
  const int left = static_cast<int>(u), top = static_cast<int>(v);
  const float right_share = u - static_cast<float>(left);
  const float lower_share = v - static_cast<float>(top);
  const std::uint8_t* upper = grey.ptr(top) + left;
  const std::uint8_t* lower = upper + grey.step[0];
  const float above =
      static_cast<float>(upper[0]) + right_share * static_cast<float>(upper[1] - upper[0]);
  const float below =
      static_cast<float>(lower[0]) + right_share * static_cast<float>(lower[1] - lower[0]);
  return above + lower_share * (below - above);
}

}  // namespace livemap::odometry
