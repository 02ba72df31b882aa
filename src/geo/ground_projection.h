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

/// How a camera sees a point of the road, and what moves the point that its pixel is projected to:
/// the derivatives of ProjectToGround, base_link's x and y.
struct GroundSensitivity {
  Eigen::Vector2d pixel;       ///< Where the camera sees the point.
  Eigen::Matrix2d per_pixel;   ///< Columns: by pixel u and v, m/px.
  Eigen::Vector2d per_pitch;   ///< By a rotation about base_link's y through the camera, m/rad.
  Eigen::Vector2d per_height;  ///< By the camera's height, m/m.
};

/// Of the road's point `point_m` (base_link, x forward and y left). None when the camera is at or
/// below the road, the point is not before it, or an input is not finite or the focal lengths are
/// not positive.
std::optional<GroundSensitivity> SensitivityOfGroundPoint(
    const Eigen::Vector2d& point_m, const CameraIntrinsics& intrinsics,
    const Eigen::Isometry3d& base_from_optical);

}  // namespace livemap::geo
