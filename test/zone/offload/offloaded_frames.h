#pragma once

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>

#include "imaging/report_picture.h"
#include "placement/sighting.h"
#include "protocol/offloaded_frame.h"

namespace livemap::zone {

constexpr std::int64_t kZoneNowNs = 1'700'000'000'000'000'000;

inline geo::CameraIntrinsics CandidateCamera() { return {500, 500, 319.5, 199.5, 640, 400}; }

/// A camera that looks straight ahead, 1.6 m above the road.
inline Eigen::Isometry3d CandidateMounting() {
  Eigen::Isometry3d base_from_optical = Eigen::Isometry3d::Identity();
  base_from_optical.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  base_from_optical.translation() << 1.5, 0.1, 1.6;
  return base_from_optical;
}

/// A frame of a vehicle that looks to the north-east; `seconds` after kZoneNowNs.
inline protocol::OffloadedFrame CandidateAt(double seconds,
                                            const std::string& vehicle_id = "car-1") {
  protocol::OffloadedFrame candidate;
  candidate.vehicle_id = vehicle_id;
  candidate.drive_id = "drive-1";
  candidate.stamp_ns = kZoneNowNs + std::llround(seconds * 1e9);
  candidate.score = 0.7F;
  candidate.base.position = {40.4433, -79.9436};
  candidate.base.covariance_m2 = Eigen::Matrix2d::Identity() * 0.25;
  candidate.base.course_rad = M_PI / 4;
  candidate.base.course_variance_rad2 = 1e-4;
  candidate.intrinsics = CandidateCamera();
  candidate.base_from_optical = CandidateMounting();
  candidate.image_frame_id = "camera_optical_frame";
  candidate.image = imaging::EncodeJpeg(
      {cv::Mat(400, 640, CV_8UC3, cv::Scalar(90, 90, 90)), nullptr}, 80, 100000);
  return candidate;
}

/// What a detector saw: one box of an object that stands at this place in base_link.
inline placement::SightingFrame AnswerOf(std::int64_t stamp_ns, double forward_m, double left_m) {
  const Eigen::Vector3d in_camera =
      CandidateMounting().inverse() * Eigen::Vector3d(forward_m, left_m, 0.0);
  const geo::CameraIntrinsics camera = CandidateCamera();
  const auto u = static_cast<float>(camera.fx * in_camera.x() / in_camera.z() + camera.cx + 0.5);
  const auto v = static_cast<float>(camera.fy * in_camera.y() / in_camera.z() + camera.cy + 0.5);
  return {stamp_ns, "candidate", 640, 400, {{"pothole", 0.8F, {u - 10, v - 12, u + 10, v}}}};
}

}  // namespace livemap::zone
