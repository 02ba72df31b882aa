#include "ros/conversions/positioning/receiver_conversions.h"

#include <limits>

#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/positioning/odometry_conversions.h"

namespace livemap::ros_io {
namespace {

constexpr double kReceiverNoNumber = std::numeric_limits<double>::quiet_NaN();

std::int8_t ReceiverStatus(receiver::FixQuality quality) {
  switch (quality) {
    case receiver::FixQuality::kDifferential:
      return sensor_msgs::NavSatStatus::STATUS_SBAS_FIX;
    case receiver::FixQuality::kRtk:
      return sensor_msgs::NavSatStatus::STATUS_GBAS_FIX;
    case receiver::FixQuality::kPlain:
      break;
  }
  return sensor_msgs::NavSatStatus::STATUS_FIX;
}

double ReceiverVariance(const std::optional<double>& sigma) {
  return sigma ? *sigma * *sigma : kUnknownVariance;
}

}  // namespace

sensor_msgs::NavSatFix ToMessage(const receiver::ReceiverFix& fix, const std::string& frame) {
  sensor_msgs::NavSatFix message = NoFixMessage(fix.stamp_ns, frame);
  message.status.status = ReceiverStatus(fix.quality);
  message.latitude = fix.position.latitude_deg;
  message.longitude = fix.position.longitude_deg;
  message.altitude = fix.height_m.value_or(kReceiverNoNumber);
  message.position_covariance[8] = ReceiverVariance(fix.up_sigma_m);
  if (fix.plane_sigma_m) {
    message.position_covariance[0] = ReceiverVariance(fix.plane_sigma_m->x());
    message.position_covariance[4] = ReceiverVariance(fix.plane_sigma_m->y());
    message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_DIAGONAL_KNOWN;
  }
  return message;
}

sensor_msgs::NavSatFix NoFixMessage(std::int64_t stamp_ns, const std::string& frame) {
  sensor_msgs::NavSatFix message;
  message.header.stamp = ToRosTime(stamp_ns);
  message.header.frame_id = frame;
  message.status.status = sensor_msgs::NavSatStatus::STATUS_NO_FIX;
  message.status.service = sensor_msgs::NavSatStatus::SERVICE_GPS;
  message.latitude = message.longitude = message.altitude = kReceiverNoNumber;
  // A reader who overlooks the type must not take a 0 for certainty.
  for (const std::size_t axis : {0U, 4U, 8U}) message.position_covariance[axis] = kUnknownVariance;
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
  return message;
}

geometry_msgs::TwistWithCovarianceStamped ToMessage(const receiver::ReceiverVelocity& velocity,
                                                    const std::string& frame) {
  geometry_msgs::TwistWithCovarianceStamped message;
  message.header.stamp = ToRosTime(velocity.stamp_ns);
  message.header.frame_id = frame;
  message.twist.twist.linear.x = velocity.plane_mps.x();
  message.twist.twist.linear.y = velocity.plane_mps.y();
  message.twist.twist.linear.z = velocity.climb_mps.value_or(0);
  boost::array<double, 36>& covariance = message.twist.covariance;
  for (std::size_t axis = 0; axis < 6; ++axis) covariance[7 * axis] = kUnknownVariance;
  if (velocity.plane_covariance) {
    const Eigen::Matrix2d& plane = *velocity.plane_covariance;
    covariance[0] = plane(0, 0);
    covariance[1] = plane(0, 1);
    covariance[6] = plane(1, 0);
    covariance[7] = plane(1, 1);
  }
  covariance[14] = ReceiverVariance(velocity.climb_sigma_mps);
  return message;
}

}  // namespace livemap::ros_io
