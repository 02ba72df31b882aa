#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "geo/camera_intrinsics.h"
#include "geo/vehicle_pose.h"

namespace livemap::protocol {

/// One picture that a small vehicle holds worth the zone's detector (CandidateFrame.msg without
/// ROS), with all that places what is seen in it.
struct OffloadedFrame {
  std::string vehicle_id;  ///< Empty on the vehicle; the zone's bridge writes the proven identity.
  std::string drive_id;
  std::int64_t stamp_ns = 0;  ///< Of the image, vehicle clock (UTC), ns since 1970.
  float score = 0;            ///< The vehicle's classifier's, 0..1.
  /// base_link: where it was at `stamp_ns` and which way it looked.
  geo::TrackPose base;
  bool fused = false;                ///< By fixes and odometry; false: by the fixes alone.
  geo::CameraIntrinsics intrinsics;  ///< Of the picture as it is sent.
  Eigen::Isometry3d base_from_optical = Eigen::Isometry3d::Identity();
  std::string image_frame_id;       ///< Optical frame of the image.
  std::vector<std::uint8_t> image;  ///< JPEG file, masked by the vehicle.
};

}  // namespace livemap::protocol
