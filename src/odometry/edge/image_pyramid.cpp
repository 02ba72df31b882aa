#include "odometry/edge/image_pyramid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>

namespace livemap::odometry {
namespace {

template <typename Depth>
void ConvertDepthForPyramid(const cv::Mat& depth, float metres_per_unit, DepthPyramid::Range range,
                            cv::Mat& metres) {
  metres.create(depth.size(), CV_32FC1);
  for (int y = 0; y < depth.rows; ++y) {
    const Depth* in = depth.ptr<Depth>(y);
    float* out = metres.ptr<float>(y);
    for (int x = 0; x < depth.cols; ++x) {
      const float value = static_cast<float>(in[x]) * metres_per_unit;
      // Written so that NaN becomes unknown too.
      out[x] = value >= range.min_m && value <= range.max_m ? value : 0.0F;
    }
  }
}

/// Mean of those of four depths that lie on the nearest surface; unknown without any.
float NearestDepthOfPyramid(const float (&depths)[4]) {
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

void HalveDepthLevel(const cv::Mat& fine, cv::Mat& coarse) {
  coarse.create(fine.rows / 2, fine.cols / 2, CV_32FC1);
  for (int y = 0; y < coarse.rows; ++y) {
    const float* upper = fine.ptr<float>(2 * y);
    const float* lower = fine.ptr<float>(2 * y + 1);
    float* out = coarse.ptr<float>(y);
    for (int x = 0; x < coarse.cols; ++x, upper += 2, lower += 2) {
      out[x] = NearestDepthOfPyramid({upper[0], upper[1], lower[0], lower[1]});
    }
  }
}

/// Means of 2x2 pixels. An odd last row or column has no partner and is left out.
void HalvePyramidLevel(const cv::Mat& fine, cv::Mat& coarse) {
  coarse.create(std::max(1, fine.rows / 2), std::max(1, fine.cols / 2), CV_8UC1);
  for (int y = 0; y < coarse.rows; ++y) {
    const std::uint8_t* upper = fine.ptr(std::min(2 * y, fine.rows - 1));
    const std::uint8_t* lower = fine.ptr(std::min(2 * y + 1, fine.rows - 1));
    std::uint8_t* out = coarse.ptr(y);
    if (fine.cols == 1) out[0] = upper[0];
    for (int x = 0; x < fine.cols / 2; ++x, upper += 2, lower += 2) {
      out[x] = static_cast<std::uint8_t>((upper[0] + upper[1] + lower[0] + lower[1] + 2) / 4);
    }
  }
}

/// (1 2 1)/4 along rows and columns; the border sees itself beyond the image. `across` is a buffer
/// of one row.
void SmoothPyramidLevel(const cv::Mat& grey, std::vector<std::uint16_t>& across, cv::Mat& smooth) {
  smooth.create(grey.size(), CV_8UC1);
  const int width = grey.cols;
  across.resize(static_cast<std::size_t>(width) + 2);
  std::uint16_t* column = across.data() + 1;
  for (int y = 0; y < grey.rows; ++y) {
    const std::uint8_t* above = grey.ptr(std::max(y - 1, 0));
    const std::uint8_t* here = grey.ptr(y);
    const std::uint8_t* below = grey.ptr(std::min(y + 1, grey.rows - 1));
    for (int x = 0; x < width; ++x) {
      column[x] = static_cast<std::uint16_t>(above[x] + 2 * here[x] + below[x]);
    }
    column[-1] = column[0];
    column[width] = column[width - 1];
    std::uint8_t* out = smooth.ptr(y);
    for (int x = 0; x < width; ++x) {
      out[x] = static_cast<std::uint8_t>((column[x - 1] + 2 * column[x] + column[x + 1] + 8) >> 4U);
    }
  }
}

/// Standard deviation of the noise of a grey image, by the median of what a mask that is blind to
/// slopes leaves of it (Immerkaer 1996, with a median, which edges spoil less than a mean). Every
/// fourth row and third column says enough.
double NoiseOfPyramid(const cv::Mat& grey) {
  constexpr double kOfMask = 6, kMedianToSigma = 0.6745;
  std::array<std::uint32_t, 16 * 255 + 1> histogram{};
  std::uint32_t count = 0;
  for (int y = 1; y < grey.rows - 1; y += 4) {
    const std::uint8_t *above = grey.ptr(y - 1), *here = grey.ptr(y), *below = grey.ptr(y + 1);
    for (int x = 1; x < grey.cols - 1; x += 3, ++count) {
      const int response = above[x - 1] + above[x + 1] + below[x - 1] + below[x + 1] -
                           2 * (above[x] + below[x] + here[x - 1] + here[x + 1]) + 4 * here[x];
      ++histogram[static_cast<std::size_t>(std::abs(response))];
    }
  }
  if (count == 0) return 0;
  std::uint32_t seen = histogram[0];
  std::size_t bin = 0;
  // A mean of neighbours takes out the steps of whole numbers.
  while (2 * seen < count) seen += histogram[++bin];
  const double share =
      histogram[bin] > 0 ? 1 - (static_cast<double>(seen) - 0.5 * count) / histogram[bin] : 0.5;
  return (bin == 0 ? share * 0.5 : static_cast<double>(bin) - 0.5 + share) / kMedianToSigma /
         kOfMask;
}

}  // namespace

int CountLevels(cv::Size size) {
  int levels = 1;
  while (levels < kMaxLevels && (size.width >> levels) >= kMinLevelWidth &&
         (size.height >> levels) >= kMinLevelHeight) {
    ++levels;
  }
  return levels;
}

geo::CameraIntrinsics HalvedIntrinsics(const geo::CameraIntrinsics& intrinsics) {
  return {intrinsics.fx / 2,
          intrinsics.fy / 2,
          (intrinsics.cx + 0.5) / 2 - 0.5,
          (intrinsics.cy + 0.5) / 2 - 0.5,
          intrinsics.width / 2,
          intrinsics.height / 2};
}

LevelCameras LevelCamerasOf(const geo::CameraIntrinsics& finest) {
  LevelCameras cameras;
  cameras.camera[0] = finest;
  cameras.levels = CountLevels({finest.width, finest.height});
  for (std::size_t level = 1; level < cameras.camera.size(); ++level) {
    cameras.camera[level] = HalvedIntrinsics(cameras.camera[level - 1]);
  }
  return cameras;
}

void ImagePyramid::Build(const cv::Mat& grey) {
  gradient_noise_ = {};
  levels_ = CountLevels(grey.size());
  SmoothPyramidLevel(grey, row_, images_[0]);
  for (std::size_t level = 1; level < static_cast<std::size_t>(levels_); ++level) {
    HalvePyramidLevel(images_[level - 1], images_[level]);
  }
  HalvePyramidLevel(images_[static_cast<std::size_t>(levels_ - 1)], thumbnail_);
}

void ImagePyramid::MeasureNoise(const cv::Mat& grey) {
  // What the smoothing and the halving leave of white noise in a central difference, and what
  // rounding to whole grey levels adds to it.
  constexpr std::array<double, kMaxLevels> kLeft = {0.0586, 0.0489, 0.0206};
  constexpr double kRounding = 1.0 / 24;
  const double noise = NoiseOfPyramid(grey);
  for (std::size_t level = 0; level < kLeft.size(); ++level) {
    gradient_noise_[level] = kLeft[level] * noise * noise + kRounding;
  }
}

void DepthPyramid::Build(const cv::Mat& depth, double units_per_m, Range range, int levels) {
  if (depth.type() == CV_16UC1) {
    ConvertDepthForPyramid<std::uint16_t>(depth, static_cast<float>(1 / units_per_m), range,
                                          depths_[0]);
  } else {
    ConvertDepthForPyramid<float>(depth, 1, range, depths_[0]);
  }
  for (std::size_t level = 1; level < static_cast<std::size_t>(levels); ++level) {
    HalveDepthLevel(depths_[level - 1], depths_[level]);
  }
}

}  // namespace livemap::odometry
