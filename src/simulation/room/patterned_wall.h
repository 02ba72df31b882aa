#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "geo/camera_intrinsics.h"

namespace livemap::simulation {

/// A wall without end with a smooth pattern of patches, 2 m before the world's origin and slanted.
/// Its pictures follow a formula: no noise, no aliasing, grey value and depth exact at every
/// pixel's centre. The world frame is a camera's optical frame.
class PatternedWall {
 public:
  struct View {
    cv::Mat grey;   ///< CV_8UC1
    cv::Mat depth;  ///< CV_32FC1, m along the optical axis.
  };

  /// The camera must be before the wall and look at it with every pixel. Grey values are those of
  /// the wall times `gain` plus `bias`.
  static View See(const geo::CameraIntrinsics& camera, const Eigen::Isometry3d& world_from_optical,
                  double gain, double bias);
};

}  // namespace livemap::simulation
