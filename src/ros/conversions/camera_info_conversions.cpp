#include "ros/conversions/camera_info_conversions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "common/error.h"

namespace livemap::ros_io {
namespace {

int CameraInfoInt(std::uint32_t value) {
  return static_cast<int>(
      std::min<std::uint32_t>(value, static_cast<std::uint32_t>(std::numeric_limits<int>::max())));
}

}  // namespace

imaging::CameraCalibration FromMessage(const sensor_msgs::CameraInfo& message) {
  imaging::CameraCalibration calibration;
  calibration.width = CameraInfoInt(message.width);
  calibration.height = CameraInfoInt(message.height);
  calibration.distortion_model = message.distortion_model;
  calibration.distortion = message.D;
  std::copy(message.K.begin(), message.K.end(), calibration.k.val);
  std::copy(message.R.begin(), message.R.end(), calibration.r.val);
  std::copy(message.P.begin(), message.P.end(), calibration.p.val);
  // Drivers that know no rectification leave R all zeros.
  if (cv::norm(calibration.r) == 0) calibration.r = cv::Matx33d::eye();
  return calibration;
}

sensor_msgs::CameraInfo ToMessage(const imaging::CameraCalibration& calibration,
                                  const std_msgs::Header& header) {
  sensor_msgs::CameraInfo message;
  message.header = header;
  message.width = static_cast<std::uint32_t>(calibration.width);
  message.height = static_cast<std::uint32_t>(calibration.height);
  message.distortion_model = calibration.distortion_model;
  message.D = calibration.distortion;
  std::copy(std::begin(calibration.k.val), std::end(calibration.k.val), message.K.begin());
  std::copy(std::begin(calibration.r.val), std::end(calibration.r.val), message.R.begin());
  std::copy(std::begin(calibration.p.val), std::end(calibration.p.val), message.P.begin());
  return message;
}

geo::CameraIntrinsics ToRectifiedIntrinsics(const sensor_msgs::CameraInfo& info) {
  constexpr std::uint32_t kMaxPixels = 16384;
  geo::CameraIntrinsics intrinsics{info.P[0], info.P[5], info.P[2], info.P[6], 0, 0};
  const bool finite = std::isfinite(intrinsics.cx) && std::isfinite(intrinsics.cy) &&
                      std::isfinite(intrinsics.fx) && std::isfinite(intrinsics.fy);
  if (!finite || !(intrinsics.fx > 0 && intrinsics.fy > 0) || info.width == 0 || info.height == 0 ||
      info.width > kMaxPixels || info.height > kMaxPixels) {
    throw Error("camera_info of '" + info.header.frame_id + "' is no calibration: its P has fx " +
                std::to_string(intrinsics.fx) + " and fy " + std::to_string(intrinsics.fy) +
                " for " + std::to_string(info.width) + "x" + std::to_string(info.height) +
                " pixels");
  }
  intrinsics.width = static_cast<int>(info.width);
  intrinsics.height = static_cast<int>(info.height);
  return intrinsics;
}

}  // namespace livemap::ros_io
