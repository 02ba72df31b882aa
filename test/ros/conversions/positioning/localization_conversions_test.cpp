#include "ros/conversions/positioning/localization_conversions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/time.h"
#include "localization/planar.h"

namespace livemap::ros_io {
namespace {

constexpr std::int64_t kBeginNs = 1'600'000'000'000'000'000;

nav_msgs::Odometry OdometryAt(double x_m, double y_m, double yaw_rad) {
  nav_msgs::Odometry message;
  message.header.stamp.fromNSec(static_cast<std::uint64_t>(kBeginNs));
  message.pose.pose.position.x = x_m;
  message.pose.pose.position.y = y_m;
  message.pose.pose.orientation.z = std::sin(yaw_rad / 2);
  message.pose.pose.orientation.w = std::cos(yaw_rad / 2);
  return message;
}

TEST(LocalizationConversions, WhatAReporterHearsIsWhatTheLocalizerKnows) {
  // Far from the datum and far north, where meridians converge.
  const geo::GeoPoint datum{69, 18};
  localization::LocalizerConfig config;
  config.datum = datum;
  config.receiver.latency_s = config.receiver.latency_sigma_s = 0;
  localization::GeoLocalizer localizer(config);
  const geo::LocalFrame map(datum);
  std::optional<localization::FusedPose> fused;
  localization::OdometrySample sample;
  for (int i = 0; i < 100; ++i) {
    sample.stamp_ns = kBeginNs + Nanoseconds(0.1 * i);
    sample.odom_from_base.translation().x() = i;
    localizer.AddOdometry(sample.stamp_ns, sample.odom_from_base);
    geo::Fix fix;
    fix.stamp_ns = sample.stamp_ns;
    fix.position = map.ToGeo(Eigen::Vector2d(40e3 + 0.6 * i, -1e3 + 0.8 * i));
    Eigen::Matrix2d covariance_m2;
    covariance_m2 << 4, 0, 0, 1;
    fix.covariance_m2 = covariance_m2;
    localizer.AddFix(fix);
    fused = localizer.Fused(sample.stamp_ns);
  }
  ASSERT_TRUE(fused && fused->state == localization::LocalizerState::kOk);
  const auto message =
      ToFusedOdometry(*fused, *localizer.MapFromOdom(), sample, OdometryAt(99, 0, 0), "map");
  const geo::TrackPose heard = ToTrackPose(message, map);
  EXPECT_LT(geo::GeodesicDistanceM(heard.position, fused->position), 1e-4);
  EXPECT_NEAR(std::remainder(heard.course_rad - fused->heading_rad, 2 * M_PI), 0, 1e-9);
  EXPECT_LT((heard.covariance_m2 - fused->covariance_m2).norm(), 1e-9);
  EXPECT_NEAR(heard.course_variance_rad2, fused->heading_variance_rad2, 1e-12);
  const auto fix = ToFusedFix(*fused, "base_link", sample.stamp_ns);
  EXPECT_EQ(fix.latitude, fused->position.latitude_deg);
  EXPECT_EQ(fix.position_covariance[1], fused->covariance_m2(0, 1));
}

TEST(LocalizationConversions, ATwistThatIsUnknownIsLostOdometry) {
  nav_msgs::Odometry message = OdometryAt(1, 2, 0.3);
  EXPECT_FALSE(ToOdometrySample(message, std::nullopt).lost);
  EXPECT_FALSE(ToOdometrySample(message, kBeginNs - 1).increment_covariance) << "none is stated";
  for (std::size_t i = 0; i < 6; ++i) message.twist.covariance[7 * i] = 1e6;
  EXPECT_TRUE(ToOdometrySample(message, std::nullopt).lost);
}

TEST(LocalizationConversions, TheTwistsCovarianceGivesThatOfTheStep) {
  nav_msgs::Odometry message = OdometryAt(1, 2, 0.3);
  message.twist.covariance[0] = 0.04;
  message.twist.covariance[7] = 0.01;
  message.twist.covariance[5] = message.twist.covariance[30] = 0.001;
  message.twist.covariance[35] = 0.0009;
  const auto sample = ToOdometrySample(message, kBeginNs - Nanoseconds(0.5));
  ASSERT_TRUE(sample.increment_covariance);
  Eigen::Matrix3d expected;
  expected << 0.01, 0, 0.00025, 0, 0.0025, 0, 0.00025, 0, 0.000225;
  EXPECT_LT((*sample.increment_covariance - expected).norm(), 1e-12);
  EXPECT_FALSE(ToOdometrySample(message, kBeginNs + 1).increment_covariance)
      << "the stamp before is later";
}

TEST(LocalizationConversions, WhatIsNoRotationIsNoPose) {
  nav_msgs::Odometry message = OdometryAt(1, 2, 0.3);
  message.pose.pose.orientation.w = std::numeric_limits<double>::quiet_NaN();
  localization::GeoLocalizer localizer({});
  const localization::OdometrySample sample = ToOdometrySample(message, std::nullopt);
  EXPECT_EQ(localizer.AddOdometry(sample.stamp_ns, sample.odom_from_base),
            localization::OdometryTrack::Verdict::kInvalid);
  message = OdometryAt(1, 2, 0.3);
  message.pose.pose.orientation = {};
  const localization::OdometrySample empty = ToOdometrySample(message, std::nullopt);
  // All zeros: Eigen makes the identity of it, which is what an unset orientation stands for.
  EXPECT_NE(localizer.AddOdometry(empty.stamp_ns, empty.odom_from_base),
            localization::OdometryTrack::Verdict::kInvalid);
}

}  // namespace
}  // namespace livemap::ros_io
