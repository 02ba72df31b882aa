#pragma once

#include <fstream>
#include <opencv2/core.hpp>
#include <string>

#include "simulation/render/street_renderer.h"

namespace livemap::simulation {

/// Depth units per metre in the TUM RGB-D benchmark's own files.
constexpr double kTumDepthScale = 5000;

/// Writes a drive in TUM RGB-D layout: rgb/, depth/ (16-bit PNG, `depth_scale` units per metre, 0:
/// sky or beyond 65535 units), rgb.txt, depth.txt, associations.txt, groundtruth.txt (optical frame
/// in the world frame, z up), camera.yaml and of a stereo pair rgb_right/ with rgb_right.txt. Every
/// Error names the path.
class TumWriter {
 public:
  /// Makes the folder; throws Error when it exists and is not empty. `baseline_m` is that of a
  /// stereo pair, 0: monocular.
  TumWriter(const std::string& directory, const SimulatedCamera& camera,
            double depth_scale = kTumDepthScale, double baseline_m = 0);
  /// `right` is the right camera's picture of a stereo pair, for rgb_right/; empty: none.
  void Add(double time_s, const SimulatedFrame& frame, const cv::Mat& right = cv::Mat());
  /// Closes the lists; throws Error when the disk was full.
  void Finish();

 private:
  std::string directory_;
  double depth_scale_;
  std::ofstream rgb_;
  std::ofstream right_;  ///< Open once there is a right camera.
  std::ofstream depth_;
  std::ofstream associations_;
  std::ofstream truth_;
};

}  // namespace livemap::simulation
