#include "ros/conversions/offload_conversions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/message_fields.h"

namespace livemap::ros_io {
namespace {

constexpr double kQuaternionNormSlack = 1e-3;

int OffloadSide(std::uint32_t pixels) {
  if (pixels <= static_cast<std::uint32_t>(std::numeric_limits<std::int16_t>::max())) {
    return static_cast<int>(pixels);
  }
  throw Error("candidate frame has an image side of " + std::to_string(pixels) +
              " pixels, accepted are at most " +
              std::to_string(std::numeric_limits<std::int16_t>::max()));
}

Eigen::Isometry3d OffloadMounting(const geometry_msgs::Transform& message) {
  Eigen::Quaterniond rotation(message.rotation.w, message.rotation.x, message.rotation.y,
                              message.rotation.z);
  // Written so that NaN is refused too.
  if (!(std::abs(rotation.norm() - 1) <= kQuaternionNormSlack)) {
    throw Error("candidate frame has a mounting whose quaternion has norm " +
                std::to_string(rotation.norm()) + ", accepted is 1");
  }
  Eigen::Isometry3d mounting = Eigen::Isometry3d::Identity();
  mounting.linear() = rotation.normalized().toRotationMatrix();
  mounting.translation() << message.translation.x, message.translation.y, message.translation.z;
  return mounting;
}

}  // namespace

CandidateFrame ToMessage(const protocol::OffloadedFrame& candidate) {
  CandidateFrame message;
  message.schema_version = CandidateFrame::SCHEMA_VERSION;
  message.vehicle_id = candidate.vehicle_id;
  message.drive_id = candidate.drive_id;
  message.stamp = ToRosTime(candidate.stamp_ns);
  message.score = candidate.score;
  message.latitude = candidate.base.position.latitude_deg;
  message.longitude = candidate.base.position.longitude_deg;
  message.covariance = ToArray(candidate.base.covariance_m2);
  message.course = candidate.base.course_rad;
  message.course_variance = candidate.base.course_variance_rad2;
  message.position_course = {
      {candidate.base.position_course.x(), candidate.base.position_course.y()}};
  message.fused = candidate.fused;
  message.image_width = static_cast<std::uint32_t>(candidate.intrinsics.width);
  message.image_height = static_cast<std::uint32_t>(candidate.intrinsics.height);
  message.fx = candidate.intrinsics.fx;
  message.fy = candidate.intrinsics.fy;
  message.cx = candidate.intrinsics.cx;
  message.cy = candidate.intrinsics.cy;
  const Eigen::Quaterniond rotation(candidate.base_from_optical.linear());
  message.mounting.rotation.w = rotation.w();
  message.mounting.rotation.x = rotation.x();
  message.mounting.rotation.y = rotation.y();
  message.mounting.rotation.z = rotation.z();
  message.mounting.translation.x = candidate.base_from_optical.translation().x();
  message.mounting.translation.y = candidate.base_from_optical.translation().y();
  message.mounting.translation.z = candidate.base_from_optical.translation().z();
  message.image.header.stamp = message.stamp;
  message.image.header.frame_id = candidate.image_frame_id;
  message.image.format = "jpeg";
  message.image.data = candidate.image;
  return message;
}

protocol::OffloadedFrame FromMessage(const CandidateFrame& message) {
  CheckVersion(message, "candidate frame");
  protocol::OffloadedFrame candidate;
  candidate.vehicle_id = message.vehicle_id;
  candidate.drive_id = message.drive_id;
  candidate.stamp_ns = FromRosTime(message.stamp);
  candidate.score = message.score;
  candidate.base.position = {message.latitude, message.longitude};
  candidate.base.covariance_m2 = ToMatrix(message.covariance);
  candidate.base.course_rad = message.course;
  candidate.base.course_variance_rad2 = message.course_variance;
  candidate.base.position_course << message.position_course[0], message.position_course[1];
  candidate.fused = message.fused != 0;
  candidate.intrinsics.fx = message.fx;
  candidate.intrinsics.fy = message.fy;
  candidate.intrinsics.cx = message.cx;
  candidate.intrinsics.cy = message.cy;
  candidate.intrinsics.width = OffloadSide(message.image_width);
  candidate.intrinsics.height = OffloadSide(message.image_height);
  candidate.base_from_optical = OffloadMounting(message.mounting);
  candidate.image_frame_id = message.image.header.frame_id;
  candidate.image = message.image.data;
  return candidate;
}

}  // namespace livemap::ros_io
