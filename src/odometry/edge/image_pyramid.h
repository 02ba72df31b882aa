#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "geo/camera_intrinsics.h"

namespace livemap::odometry {

/// Edges alias on coarser images than this (thesis, section 5.2.4); no level goes below.
constexpr int kMinLevelWidth = 160;
constexpr int kMinLevelHeight = 120;
constexpr int kMaxLevels = 3;

/// Levels of an image of this size, 1..kMaxLevels; level 0 is the image itself.
int CountLevels(cv::Size size);

/// The camera of a level whose pixels are 2x2 pixels of the level before: the centre of the first
/// pixel moves by half a pixel.
geo::CameraIntrinsics HalvedIntrinsics(const geo::CameraIntrinsics& intrinsics);

/// The cameras of an image's levels.
struct LevelCameras {
  std::array<geo::CameraIntrinsics, kMaxLevels + 1> camera;  ///< The last one is the thumbnail's.
  int levels = 1;
};
LevelCameras LevelCamerasOf(const geo::CameraIntrinsics& finest);

/// Grey images, CV_8UC1. The buffers are kept from frame to frame.
class ImagePyramid {
 public:
  /// `grey` is smoothed by (1 2 1)/4 both ways; its size decides the number of levels.
  void Build(const cv::Mat& grey);
  int levels() const { return levels_; }
  const cv::Mat& operator[](int level) const { return images_[static_cast<std::size_t>(level)]; }
  /// A small and smooth view of the whole image: 80x60 for 640x480.
  const cv::Mat& thumbnail() const { return thumbnail_; }
  /// Measures the noise of `grey`, the picture that the pyramid was built of.
  void MeasureNoise(const cv::Mat& grey);
  /// Variance of the central difference of a level's grey values, along either axis, that the
  /// camera's noise and the rounding to whole grey levels alone make; 0: not measured.
  double GradientNoise(int level) const { return gradient_noise_[static_cast<std::size_t>(level)]; }

 private:
  int levels_ = 0;
  std::array<cv::Mat, kMaxLevels> images_;
  std::array<double, kMaxLevels> gradient_noise_{};
  cv::Mat thumbnail_;
  std::vector<std::uint16_t> row_;
};

/// Depth along the optical axis in metres, CV_32FC1, 0 where it is not known.
class DepthPyramid {
 public:
  struct Range {
    float min_m = 0.1F;
    float max_m = 100.0F;
  };

  /// `depth` is CV_16UC1 in 1/units_per_m or CV_32FC1 in metres; what is not finite or outside the
  /// range becomes unknown. A coarser pixel is the mean of those of its four that lie within
  /// kSameSurface of the nearest: neither holes nor the step behind an edge are blended in.
  void Build(const cv::Mat& depth, double units_per_m, Range range, int levels);
  const cv::Mat& operator[](int level) const { return depths_[static_cast<std::size_t>(level)]; }
  void Clear() { depths_ = {}; }

  static constexpr float kSameSurface = 1.05F;

 private:
  std::array<cv::Mat, kMaxLevels> depths_;
};

}  // namespace livemap::odometry
