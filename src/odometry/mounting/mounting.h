#pragma once

#include <Eigen/Geometry>

namespace livemap::odometry {

/// How a camera looks out of the vehicle: base_link (x forward, y left, z up, its origin on the
/// road) to camera, the angles as tf and config/cameras have them (yaw, then pitch, then roll).
struct Mounting {
  double yaw_rad = 0;    ///< Positive looks left.
  double pitch_rad = 0;  ///< Positive looks down.
  double roll_rad = 0;   ///< Positive: right side down.
  double height_m = 0;   ///< Of the optical centre over the road.
};

/// Rotation of the optical frame (x right, y down, z forward) in base_link; the height is not read.
Eigen::Matrix3d BaseFromOpticalRotation(const Mounting& mounting);

/// The angles, within a quarter turn, of a rotation of the optical frame in base_link.
Mounting MountingOfRotation(const Eigen::Matrix3d& base_from_optical);

/// base_link's x (forward) and -z (down) as the camera sees them, unit vectors in the optical
/// frame.
struct VehicleAxes {
  Eigen::Vector3d forward;
  Eigen::Vector3d down;
};
VehicleAxes AxesInCamera(const Mounting& mounting);

/// The mounting that sees the axes so, which are at right angles; the height is 0.
Mounting MountingOfAxes(const VehicleAxes& axes);

}  // namespace livemap::odometry
