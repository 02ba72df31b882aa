#pragma once

#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "drives/generated_world.h"

namespace livemap {

/// The outline of a pothole: radius over angle, metres; angle 0 points along the road.
class PotholeShape {
 public:
  explicit PotholeShape(const GeneratedHazard& hazard);
  double RadiusM(double angle_rad) const;
  double max_radius_m() const { return max_radius_m_; }

 private:
  double along_m_;  ///< Half axes of the ellipse that the rim wobbles about.
  double across_m_;
  std::vector<double> amplitude_;
  std::vector<double> phase_;
  double max_radius_m_ = 0;
};

/// Colour of the ground from above: asphalt with wear, cracks, patches, markings and potholes,
/// grass beside it. Painted tile by tile as it comes into view, each with its mip pyramid; what
/// lies behind is forgotten, so memory stays flat over a long drive. Not thread-safe.
class GeneratedGround {
 public:
  explicit GeneratedGround(const GeneratedWorld& world);

  static constexpr double kResolutionM = 0.0125;  ///< Of mip level 0.
  static constexpr double kTileM = 10;
  static constexpr int kLevels = 6;

  /// Paints what `from_m` to `to_m` along the road needs and forgets the rest.
  void Prepare(double from_m, double to_m);
  /// BGR at a point, bilinear in mip level `level`. The point must be prepared.
  cv::Vec3f At(double along_m, double left_m, int level) const;

 private:
  using Pyramid = std::vector<cv::Mat>;
  Pyramid PaintTile(std::int64_t tile) const;
  void PaintAsphalt(std::int64_t tile, cv::Mat& image) const;
  void PaintMarkings(std::int64_t tile, cv::Mat& image) const;
  void PaintWear(std::int64_t tile, cv::Mat& image) const;
  void PaintPothole(const GeneratedHazard& hazard, std::int64_t tile, cv::Mat& image) const;
  float Noise(const cv::Mat& noise, double along_m, double left_m, double scale) const;

  const GeneratedWorld& world_;
  cv::Mat fine_;  ///< Periodic noise, CV_32F, mean 0, sigma 1.
  cv::Mat coarse_;
  Pyramid grass_;
  std::map<std::int64_t, Pyramid> tiles_;
};

}  // namespace livemap
