#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "geo/camera_intrinsics.h"
#include "odometry/edge/image_pyramid.h"

namespace livemap::odometry {

/// Pixels of a keyframe, spread over its picture, in each cell the one furthest from any edge:
/// where a motion is true, a later frame shows their grey values again. Of a pattern that repeats
/// itself edges say the same in each of its periods; what tells one tile from the next is its
/// shade.
class PicturePoints {
 public:
  static constexpr std::size_t kMost = 1200;
  /// The level of the pyramids whose pixels they are.
  static int LevelOf(int levels) { return levels > 1 ? 1 : 0; }

  /// Memory for kMost points, which is the most that are taken.
  void Reserve() { points_.reserve(kMost); }
  void Clear() { points_.clear(); }
  std::size_t size() const { return points_.size(); }

  /// Takes points of a picture (CV_8UC1) with its depth (CV_32FC1, m, 0 unknown) of this camera.
  void Take(const cv::Mat& grey, const cv::Mat& depth_m, const geo::CameraIntrinsics& camera);

  /// How a frame's picture of the same level differs at the points, in grey levels, once the light
  /// on all of them is brought into line (gain, and a bias that may grow across the picture; fitted
  /// robustly).
  struct Differences {
    std::array<float, kMost> value;
    std::size_t count = 0;
    /// Robust standard deviation, by the median; infinite without any.
    double Sigma() const;
    double ShareWithin(double bound) const;
  };

  /// Of every `every`-th point that is in view. None at all where too few are.
  void Compare(const cv::Mat& grey, const geo::CameraIntrinsics& camera,
               const Eigen::Isometry3d& new_from_reference, std::size_t every,
               Differences& differences) const;

 private:
  struct PicturePoint {
    Eigen::Vector3f place;  // In the keyframe's optical frame, m.
    float grey;
  };
  std::vector<PicturePoint> points_;
};

/// Up to how many grey levels a difference is noise where the best of some motions leaves this
/// sigma: this camera may err by less than others.
double PictureBound(double least_sigma);

}  // namespace livemap::odometry
