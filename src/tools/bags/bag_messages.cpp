#include "tools/bags/bag_messages.h"

#include <limits>

#include "tools/bags/bag_writer.h"

namespace livemap::tools {
namespace {

geometry_msgs::TransformStamped DriveTransform(const Eigen::Isometry3d& pose,
                                               const ros::Time& stamp, const std::string& parent,
                                               const std::string& child) {
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = stamp;
  transform.header.frame_id = parent;
  transform.child_frame_id = child;
  transform.transform.translation.x = pose.translation().x();
  transform.transform.translation.y = pose.translation().y();
  transform.transform.translation.z = pose.translation().z();
  const Eigen::Quaterniond rotation(pose.linear());
  transform.transform.rotation.x = rotation.x();
  transform.transform.rotation.y = rotation.y();
  transform.transform.rotation.z = rotation.z();
  transform.transform.rotation.w = rotation.w();
  return transform;
}

}  // namespace

tf2_msgs::TFMessage MountingTransforms(const datasets::CameraMounting& mounting,
                                       const ros::Time& stamp) {
  tf2_msgs::TFMessage transforms;
  transforms.transforms = {
      DriveTransform(mounting.BaseFromCamera(), stamp, "base_link", "camera_link"),
      DriveTransform(datasets::CameraFromOptical(), stamp, "camera_link", kOpticalFrame)};
  return transforms;
}

sensor_msgs::NavSatFix DriveFix(const geo::GeoPoint& position, double sigma_m,
                                const ros::Time& stamp) {
  sensor_msgs::NavSatFix fix;
  fix.header.stamp = stamp;
  fix.header.frame_id = "base_link";
  fix.status.status = sensor_msgs::NavSatStatus::STATUS_FIX;
  fix.status.service = sensor_msgs::NavSatStatus::SERVICE_GPS;
  fix.latitude = position.latitude_deg;
  fix.longitude = position.longitude_deg;
  const double variance = sigma_m * sigma_m;
  // Heights are not simulated: 0 with a variance that says so.
  fix.position_covariance = {variance, 0, 0, 0, variance, 0, 0, 0, 1e6};
  fix.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_DIAGONAL_KNOWN;
  return fix;
}

sensor_msgs::NavSatFix DriveWithoutFix(const ros::Time& stamp) {
  sensor_msgs::NavSatFix fix;
  fix.header.stamp = stamp;
  fix.header.frame_id = "base_link";
  fix.status.status = sensor_msgs::NavSatStatus::STATUS_NO_FIX;
  fix.status.service = sensor_msgs::NavSatStatus::SERVICE_GPS;
  fix.latitude = fix.longitude = fix.altitude = std::numeric_limits<double>::quiet_NaN();
  fix.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
  return fix;
}

sensor_msgs::CameraInfo PinholeCameraInfo(const geo::CameraIntrinsics& k) {
  sensor_msgs::CameraInfo info;
  info.header.frame_id = kOpticalFrame;
  info.width = static_cast<std::uint32_t>(k.width);
  info.height = static_cast<std::uint32_t>(k.height);
  info.distortion_model = "plumb_bob";
  info.D.assign(5, 0.0);
  info.K = {k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {k.fx, 0, k.cx, 0, 0, k.fy, k.cy, 0, 0, 0, 1, 0};
  return info;
}

}  // namespace livemap::tools
