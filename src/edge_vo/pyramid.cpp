#include "edge_vo/pyramid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace livemap {
namespace {

void ConvertDepth(const cv::Mat& depth, double units_per_m, DepthPyramid::Range range,
                  cv::Mat& metres) {
  if (depth.type() == CV_16UC1) {
    depth.convertTo(metres, CV_32F, 1 / units_per_m);
  } else {
    depth.copyTo(metres);
  }
  for (int y = 0; y < metres.rows; ++y) {
    float* row = metres.ptr<float>(y);
    for (int x = 0; x < metres.cols; ++x) {
      // Written so that NaN becomes unknown too.
      row[x] = row[x] >= range.min_m && row[x] <= range.max_m ? row[x] : 0.0F;
    }
  }
}

/// Mean of those of four depths that lie on the nearest surface; unknown without any.
float NearestSurface(const float (&depths)[4]) {
  float nearest = std::numeric_limits<float>::infinity();
  for (const float depth : depths) {
    if (depth > 0) nearest = std::min(nearest, depth);
  }
  float sum = 0;
  float count = 0;
  for (const float depth : depths) {
    const bool same = depth > 0 && depth <= nearest * DepthPyramid::kSameSurface;
    sum += same ? depth : 0.0F;
    count += same ? 1.0F : 0.0F;
  }
  return count > 0 ? sum / count : 0.0F;
}

void HalveDepth(const cv::Mat& fine, cv::Mat& coarse) {
  coarse.create(fine.rows / 2, fine.cols / 2, CV_32FC1);
  for (int y = 0; y < coarse.rows; ++y) {
    const float* upper = fine.ptr<float>(2 * y);
    const float* lower = fine.ptr<float>(2 * y + 1);
    float* out = coarse.ptr<float>(y);
    for (int x = 0; x < coarse.cols; ++x) {
      out[x] = NearestSurface({upper[2 * x], upper[2 * x + 1], lower[2 * x], lower[2 * x + 1]});
    }
  }
}

void Halve(const cv::Mat& fine, cv::Mat& coarse) {
  // An odd last row or column has no partner and is left out, so that pixels stay 2x2.
  const cv::Mat even = fine(cv::Rect(0, 0, fine.cols / 2 * 2, fine.rows / 2 * 2));
  cv::resize(even, coarse, cv::Size(fine.cols / 2, fine.rows / 2), 0, 0, cv::INTER_AREA);
}

}  // namespace

int CountLevels(cv::Size size) {
  int levels = 1;
  while (levels < kMaxLevels && (size.width >> levels) >= kLeastLevelWidth &&
         (size.height >> levels) >= kLeastLevelHeight) {
    ++levels;
  }
  return levels;
}

CameraIntrinsics HalvedIntrinsics(const CameraIntrinsics& intrinsics) {
  return {intrinsics.fx / 2,
          intrinsics.fy / 2,
          (intrinsics.cx + 0.5) / 2 - 0.5,
          (intrinsics.cy + 0.5) / 2 - 0.5,
          intrinsics.width / 2,
          intrinsics.height / 2};
}

void ImagePyramid::Build(const cv::Mat& grey) {
  levels_ = CountLevels(grey.size());
  cv::GaussianBlur(grey, images_[0], {3, 3}, 0);
  for (std::size_t level = 1; level < static_cast<std::size_t>(levels_); ++level) {
    Halve(images_[level - 1], images_[level]);
  }
  Halve(images_[static_cast<std::size_t>(levels_ - 1)], thumbnail_);
}

void DepthPyramid::Build(const cv::Mat& depth, double units_per_m, Range range, int levels) {
  ConvertDepth(depth, units_per_m, range, depths_[0]);
  for (std::size_t level = 1; level < static_cast<std::size_t>(levels); ++level) {
    HalveDepth(depths_[level - 1], depths_[level]);
  }
}

}  // namespace livemap
