#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>

#include "geo/camera_intrinsics.h"
#include "simulation/render/lighting.h"

namespace livemap::simulation {

/// A camera as it is built: optics and sensor.
struct SimulatedCamera {
  geo::CameraIntrinsics intrinsics{500, 500, 319.5, 239.5, 640, 480};
  double k1 = 0;  ///< Radial distortion, as OpenCV's plumb_bob.
  double k2 = 0;
  float shot_noise = 0.010F;   ///< Standard deviation at white, as share of white.
  float read_noise = 0.0025F;  ///< In darkness, as share of white.
  float vignetting = 0.22F;    ///< Loss of light in the corners.
  int blur_samples = 0;        ///< Pictures averaged over the exposure; 0: no motion blur.
  double exposure_s = 0.008;   ///< Shutter time for motion blur.

  /// Ray through a pixel in the optical frame, its z component 1.
  Eigen::Vector3d Ray(double column, double row) const;
  /// Pixel of a point in the optical frame, z positive.
  Eigen::Vector2d Project(const Eigen::Vector3d& point) const;
};

/// The exposure control's gain for linear light (CV_32FC3), around `start`, which brings the mean
/// towards `key`.
float MeterExposure(const cv::Mat& light, float start, float key);

/// One row of linear light to 8-bit BGR: gain, vignetting, noise, tone curve. Each pixel's noise
/// depends on `noise_seed`, its row and its column only.
void DevelopRow(const SimulatedCamera& camera, const cv::Mat& light, int row, float gain,
                std::uint32_t noise_seed, cv::Mat& bgr);

}  // namespace livemap::simulation
