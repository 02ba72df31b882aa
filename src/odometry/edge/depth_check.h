#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "geo/camera_intrinsics.h"
#include "odometry/edge/rgbd_frame.h"

namespace livemap::odometry {

/// Points of a keyframe's surfaces, spread over its image whether or not there are edges: where a
/// motion is true, a later frame measures the same surfaces.
class SurfacePoints {
 public:
  /// At most this many are kept.
  static constexpr std::size_t kMost = 1200;

  /// Memory for kMost points.
  void Reserve() { points_.reserve(kMost); }
  void Clear() { points_.clear(); }
  /// Takes points of a depth image (CV_32FC1, m, 0 unknown) of this camera, evenly spread.
  void Take(const cv::Mat& depth_m, const geo::CameraIntrinsics& camera);

  /// The share of the points in view of `frame` that lie on what it measures there, within what
  /// a depth camera errs by; camera is the frame's. None when too few points meet a measurement:
  /// the frame has no depth, or looks elsewhere.
  std::optional<double> Agreement(const RgbdFrame& frame, const geo::CameraIntrinsics& camera,
                                  const Eigen::Isometry3d& new_from_reference) const;

 private:
  std::vector<Eigen::Vector3f> points_;  // In the keyframe's optical frame, m.
};

}  // namespace livemap::odometry
