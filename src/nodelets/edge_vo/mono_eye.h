#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>

#include "geo/camera_intrinsics.h"
#include "geo/vehicle_pose.h"
#include "odometry/monocular/monocular_odometry.h"
#include "odometry/monocular/vehicle_speed.h"

namespace livemap::nodelets {

/// The odometry of one eye on board: MonocularOdometry with what the vehicle knows in metres: the
/// speed of its wheels or of its receiver, its fixes, the height of its camera. Not thread-safe.
class MonoEye {
 public:
  /// `base_from_optical` is the camera's mounting: base_link stands on the road. Throws as
  /// MonocularOdometry does.
  MonoEye(const odometry::MonocularOdometry::Config& config, const geo::CameraIntrinsics& camera,
          const Eigen::Isometry3d& base_from_optical);

  /// Of kWheels or kReceiver; one that cannot be is passed over.
  void AddSpeed(odometry::MetresSource source, std::int64_t stamp_ns, double mps, double sigma_mps);
  void AddFix(const geo::Fix& fix);
  /// Throws as MonocularOdometry::Track.
  odometry::VoResult Track(std::int64_t stamp_ns, const cv::Mat& grey);
  void Reset();

  const odometry::MonocularOdometry& odometry() const { return odometry_; }

 private:
  odometry::VehicleSpeed speed_;
  odometry::MonocularOdometry odometry_;
};

}  // namespace livemap::nodelets
