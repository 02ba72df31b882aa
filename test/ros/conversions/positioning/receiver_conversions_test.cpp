#include "ros/conversions/positioning/receiver_conversions.h"

#include <gtest/gtest.h>

#include <cmath>

namespace livemap::ros_io {
namespace {

constexpr std::int64_t kReceiverStampNs = 1'795'653'934'190'000'000;

receiver::ReceiverFix FixOfAllKnown() {
  receiver::ReceiverFix fix;
  fix.stamp_ns = kReceiverStampNs;
  fix.position = {-27.6, -48.5};
  fix.height_m = 15;
  fix.plane_sigma_m = Eigen::Vector2d(2, 3);
  fix.up_sigma_m = 5;
  return fix;
}

TEST(ReceiverConversions, AFixHasPositionHeightAndADiagonalOfVariances) {
  const sensor_msgs::NavSatFix message = ToMessage(FixOfAllKnown(), "gps");
  EXPECT_EQ(message.header.stamp.toNSec(), static_cast<std::uint64_t>(kReceiverStampNs));
  EXPECT_EQ(message.header.frame_id, "gps");
  EXPECT_EQ(message.latitude, -27.6);
  EXPECT_EQ(message.longitude, -48.5);
  EXPECT_EQ(message.altitude, 15);
  EXPECT_EQ(message.position_covariance_type,
            sensor_msgs::NavSatFix::COVARIANCE_TYPE_DIAGONAL_KNOWN);
  const boost::array<double, 9> wanted = {{4, 0, 0, 0, 9, 0, 0, 0, 25}};
  EXPECT_EQ(message.position_covariance, wanted);
}

TEST(ReceiverConversions, WhatAFixDoesNotKnowIsNeverCertain) {
  receiver::ReceiverFix fix = FixOfAllKnown();
  fix.height_m.reset();
  fix.up_sigma_m.reset();
  sensor_msgs::NavSatFix message = ToMessage(fix, "gps");
  EXPECT_TRUE(std::isnan(message.altitude));
  EXPECT_EQ(message.position_covariance[8], 1e6);
  EXPECT_EQ(message.position_covariance[0], 4);
  fix.plane_sigma_m.reset();
  message = ToMessage(fix, "gps");
  EXPECT_EQ(message.position_covariance_type, sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN);
  EXPECT_EQ(message.position_covariance[0], 1e6);
  EXPECT_EQ(message.position_covariance[4], 1e6);
}

TEST(ReceiverConversions, TheStatusSaysHowAFixWasMade) {
  receiver::ReceiverFix fix = FixOfAllKnown();
  EXPECT_EQ(ToMessage(fix, "gps").status.status, sensor_msgs::NavSatStatus::STATUS_FIX);
  fix.quality = receiver::FixQuality::kDifferential;
  EXPECT_EQ(ToMessage(fix, "gps").status.status, sensor_msgs::NavSatStatus::STATUS_SBAS_FIX);
  fix.quality = receiver::FixQuality::kRtk;
  EXPECT_EQ(ToMessage(fix, "gps").status.status, sensor_msgs::NavSatStatus::STATUS_GBAS_FIX);
}

TEST(ReceiverConversions, NoFixHasNoPosition) {
  const sensor_msgs::NavSatFix message = NoFixMessage(kReceiverStampNs, "gps");
  EXPECT_EQ(message.status.status, sensor_msgs::NavSatStatus::STATUS_NO_FIX);
  EXPECT_TRUE(std::isnan(message.latitude) && std::isnan(message.longitude));
  EXPECT_EQ(message.position_covariance_type, sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN);
}

TEST(ReceiverConversions, AVelocityIsEastNorthUpWithItsCovariance) {
  receiver::ReceiverVelocity velocity;
  velocity.stamp_ns = kReceiverStampNs;
  velocity.plane_mps = {3, 4};
  velocity.climb_mps = -1;
  velocity.climb_sigma_mps = 0.5;
  Eigen::Matrix2d covariance;
  covariance << 0.04, 0.01, 0.01, 0.09;
  velocity.plane_covariance = covariance;
  const geometry_msgs::TwistWithCovarianceStamped message = ToMessage(velocity, "gps");
  EXPECT_EQ(message.header.stamp.toNSec(), static_cast<std::uint64_t>(kReceiverStampNs));
  EXPECT_EQ(message.twist.twist.linear.x, 3);
  EXPECT_EQ(message.twist.twist.linear.y, 4);
  EXPECT_EQ(message.twist.twist.linear.z, -1);
  EXPECT_EQ(message.twist.covariance[0], 0.04);
  EXPECT_EQ(message.twist.covariance[1], 0.01);
  EXPECT_EQ(message.twist.covariance[6], 0.01);
  EXPECT_EQ(message.twist.covariance[7], 0.09);
  EXPECT_EQ(message.twist.covariance[14], 0.25);
  for (const std::size_t rotation : {21U, 28U, 35U}) {
    EXPECT_EQ(message.twist.covariance[rotation], 1e6);
  }
}

TEST(ReceiverConversions, WhatAVelocityDoesNotKnowIsNeverCertain) {
  receiver::ReceiverVelocity velocity;
  velocity.stamp_ns = kReceiverStampNs;
  const geometry_msgs::TwistWithCovarianceStamped message = ToMessage(velocity, "gps");
  for (std::size_t axis = 0; axis < 6; ++axis) EXPECT_EQ(message.twist.covariance[7 * axis], 1e6);
}

}  // namespace
}  // namespace livemap::ros_io
