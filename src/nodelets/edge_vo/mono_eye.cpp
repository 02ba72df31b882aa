#include "nodelets/edge_vo/mono_eye.h"

#include <algorithm>
#include <cmath>

namespace livemap::nodelets {
namespace {

odometry::MonocularOdometry::Config WithMounting(odometry::MonocularOdometry::Config config,
                                                 const Eigen::Isometry3d& base_from_optical) {
  config.scale_source = odometry::ScaleSource::kBest;
  config.camera_height_m = base_from_optical.translation().z();
  const double up = base_from_optical.linear().col(2).z();  // Of where the camera looks.
  config.camera_pitch_rad = -std::asin(std::clamp(up, -1.0, 1.0));
  return config;
}

}  // namespace

MonoEye::MonoEye(const odometry::MonocularOdometry::Config& config,
                 const geo::CameraIntrinsics& camera, const Eigen::Isometry3d& base_from_optical)
    : odometry_(WithMounting(config, base_from_optical), camera) {}

odometry::VoResult MonoEye::Track(std::int64_t stamp_ns, const cv::Mat& grey,
                                  const std::optional<odometry::VehicleSpeed::Speed>& speed) {
  odometry::MonocularFrame frame;
  frame.stamp_ns = stamp_ns;
  frame.grey = grey;
  if (speed) {
    frame.speed_mps = speed->mps;
    frame.speed_sigma_mps = speed->sigma_mps;
    frame.speed_source = speed->source;
  }
  return odometry_.Track(frame);
}

}  // namespace livemap::nodelets
