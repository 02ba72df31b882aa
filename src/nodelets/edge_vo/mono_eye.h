#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>

#include "geo/camera_intrinsics.h"
#include "geo/vehicle_pose.h"
#include "odometry/monocular/monocular_odometry.h"
#include "odometry/monocular/vehicle_speed.h"

namespace livemap::nodelets {

/// The odometry of one eye on board: MonocularOdometry with what the vehicle knows in metres: its
/// speed, its fixes, the height of its camera. Not thread-safe.
class MonoEye {
 public:
  /// `base_from_optical` is the camera's mounting: base_link stands on the road. Throws as
  /// MonocularOdometry does.
  MonoEye(const odometry::MonocularOdometry::Config& config, const geo::CameraIntrinsics& camera,
          const Eigen::Isometry3d& base_from_optical);

  void AddFix(const geo::Fix& fix) { odometry_.AddFix(fix); }
  /// `speed` is the vehicle's at that moment. Throws as MonocularOdometry::Track.
  odometry::VoResult Track(std::int64_t stamp_ns, const cv::Mat& grey,
                           const std::optional<odometry::VehicleSpeed::Speed>& speed);
  void Reset() { odometry_.Reset(); }

  const odometry::MonocularOdometry& odometry() const { return odometry_; }

 private:
  odometry::MonocularOdometry odometry_;
};

}  // namespace livemap::nodelets
