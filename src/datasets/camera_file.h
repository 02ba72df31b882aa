#pragma once

#include <Eigen/Geometry>
#include <string>

#include "geo/camera_intrinsics.h"

namespace livemap::datasets {

/// Where a camera sits on the vehicle: base_link (x forward, y left, z up, on the road) to camera.
struct CameraMounting {
  double forward_m = 0;
  double left_m = 0;
  double height_m = 1.5;
  double roll_deg = 0;   ///< About the viewing direction, positive: right side down.
  double pitch_deg = 0;  ///< Positive: looks down.
  double yaw_deg = 0;    ///< Positive: looks to the left.

  /// Pose of camera_link (x forward along the view, y left, z up) in base_link.
  Eigen::Isometry3d BaseFromCamera() const;
  /// Pose of the optical frame (x right, y down, z forward) in base_link.
  Eigen::Isometry3d BaseFromOptical() const;
};

/// Pose of the optical frame in camera_link, the same for every camera (REP 103).
Eigen::Isometry3d CameraFromOptical();

/// A camera as config/cameras/*.yaml states it: an ideal pinhole and its place on the vehicle.
struct CameraFile {
  std::string name;
  geo::CameraIntrinsics intrinsics;
  CameraMounting mounting;
};

/// Throws Error naming the key, its value and what is accepted; unknown keys are refused.
CameraFile ReadCameraFile(const std::string& path);
CameraFile ParseCameraFile(const std::string& yaml, const std::string& name);
/// What ParseCameraFile reads back.
std::string FormatCameraFile(const CameraFile& camera);

}  // namespace livemap::datasets
