#include "tools/bags/recording_bag.h"

#include <geometry_msgs/TwistWithCovarianceStamped.h>
#include <sensor_msgs/CompressedImage.h>

#include <algorithm>
#include <cmath>

#include "common/time.h"
#include "tools/bags/bag_messages.h"

namespace livemap::tools {
namespace {

/// Of a receiver's speed, by Doppler, along each axis.
constexpr double kVelocitySigmaMps = 0.3;
constexpr double kUnknownRecordingVariance = 1e6;

ros::Time RecordingTime(std::int64_t stamp_ns) {
  return ros::Time(static_cast<std::uint32_t>(stamp_ns / 1'000'000'000),
                   static_cast<std::uint32_t>(stamp_ns % 1'000'000'000));
}

sensor_msgs::CameraInfo CalibrationMessage(const imaging::CameraCalibration& calibration) {
  sensor_msgs::CameraInfo info;
  info.header.frame_id = kOpticalFrame;
  info.width = static_cast<std::uint32_t>(calibration.width);
  info.height = static_cast<std::uint32_t>(calibration.height);
  info.distortion_model = calibration.distortion_model;
  info.D = calibration.distortion;
  std::copy_n(calibration.k.val, 9, info.K.begin());
  std::copy_n(calibration.r.val, 9, info.R.begin());
  std::copy_n(calibration.p.val, 12, info.P.begin());
  return info;
}

geometry_msgs::TwistWithCovarianceStamped VelocityMessage(double speed_mps, double course_deg,
                                                          const ros::Time& stamp) {
  geometry_msgs::TwistWithCovarianceStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = "base_link";
  const double course_rad = course_deg * geo::kRadiansPerDegree;
  message.twist.twist.linear.x = speed_mps * std::sin(course_rad);
  message.twist.twist.linear.y = speed_mps * std::cos(course_rad);
  for (std::size_t axis = 0; axis < 6; ++axis) {
    message.twist.covariance[7 * axis] =
        axis < 2 ? kVelocitySigmaMps * kVelocitySigmaMps : kUnknownRecordingVariance;
  }
  return message;
}

}  // namespace

RecordingBag::RecordingBag(const std::string& path, RecordingSetup setup, std::int64_t begin_ns)
    : setup_(std::move(setup)),
      bag_(path, BagWriter::Compression::kNone),
      info_(CalibrationMessage(setup_.calibration)),
      last_frame_ns_(begin_ns) {
  const std::int64_t first_ns = begin_ns - Nanoseconds(kLeadS);
  const auto& positions = setup_.track.positions;
  while (next_position_ < positions.size() && positions[next_position_].stamp_ns < first_ns) {
    ++next_position_;
  }
  const ros::Time stamp = RecordingTime(first_ns);
  bag_.WriteLatched("/tf_static", stamp, MountingTransforms(setup_.mounting, stamp));
}

void RecordingBag::WriteFixesUntil(std::int64_t stamp_ns) {
  const auto& positions = setup_.track.positions;
  for (; next_position_ < positions.size(); ++next_position_) {
    const recordings::RecordedPosition& position = positions[next_position_];
    if (position.stamp_ns > stamp_ns) return;
    const ros::Time stamp = RecordingTime(position.stamp_ns);
    const double sigma_m = position.sigma_m.value_or(setup_.default_sigma_m);
    bag_.Write("/fix", stamp, DriveFix(position.position, sigma_m, stamp));
    ++fixes_;
    if (!position.speed_mps || !position.course_deg) continue;
    bag_.Write("/gps/velocity", stamp,
               VelocityMessage(*position.speed_mps, *position.course_deg, stamp));
  }
}

void RecordingBag::AddFrame(std::int64_t stamp_ns, const std::vector<std::uint8_t>& jpeg) {
  WriteFixesUntil(stamp_ns);
  last_frame_ns_ = stamp_ns;
  info_.header.seq = frames_++;
  info_.header.stamp = RecordingTime(stamp_ns);
  bag_.Write("/camera/camera_info", info_.header.stamp, info_);
  sensor_msgs::CompressedImage image;
  image.header = info_.header;
  image.format = "bgr8; jpeg compressed bgr8";
  image.data = jpeg;
  bag_.Write("/camera/image_raw/compressed", image.header.stamp, image);
}

void RecordingBag::Finish() {
  WriteFixesUntil(last_frame_ns_ + Nanoseconds(kLeadS));
  bag_.Finish();
}

}  // namespace livemap::tools
