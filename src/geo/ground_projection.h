#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "geo/camera_intrinsics.h"

namespace livemap::geo {

/// What makes a projected point uncertain: independent, zero-mean, standard deviations.
struct GroundProjectionNoise {
  double pixel_sigma_px = 3.0;     ///< Of the pixel per axis: how well a box's edge is placed.
  double pitch_sigma_rad = 0.004;  ///< Rotation about base_link's y: suspension and mounting.
  double height_sigma_m = 0.03;    ///< Camera height above the road: load and road crown.
  double max_range_m = 60.0;       ///< Horizontal distance from the camera; beyond it: no point.
};

/// Where a pixel's ray meets the road.
struct GroundPoint {
  Eigen::Vector2d position_m;     ///< base_link: x forward, y left.
  Eigen::Matrix2d covariance_m2;  ///< Of position_m, same axes.
};

/// Follows the ray of `pixel` to the road, the plane z = 0 of base_link, and propagates the noise
/// through the analytic Jacobian to first order.
///
/// None when the ray does not come down to the road in front of the camera (at or above the
/// horizon, camera at or below the road), ends beyond `noise.max_range_m`, or an input is not
/// finite or the focal lengths are not positive.
///
/// With C the camera's centre and d the ray's direction in base_link, the point is
/// P = C - (C_z / d_z) d. A pitch error rotates C's ray about base_link's y axis through the
/// camera's centre; a height error shifts C along z.
std::optional<GroundPoint> ProjectToGround(const Eigen::Vector2d& pixel,
                                           const CameraIntrinsics& intrinsics,
                                           const Eigen::Isometry3d& base_from_optical,
                                           const GroundProjectionNoise& noise);

}  // namespace livemap::geo
