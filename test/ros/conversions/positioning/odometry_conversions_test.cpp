#include "ros/conversions/positioning/odometry_conversions.h"

#include <gtest/gtest.h>

#include <cmath>

namespace livemap::ros_io {
namespace {

constexpr double kDegree = M_PI / 180;

Eigen::Isometry3d Mounted(double yaw_deg, double pitch_deg, double height_m) {
  Eigen::Matrix3d link_from_optical;
  link_from_optical << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(1.5, 0, height_m);
  pose.linear() = Eigen::AngleAxisd(yaw_deg * kDegree, Eigen::Vector3d::UnitZ()) *
                  Eigen::AngleAxisd(pitch_deg * kDegree, Eigen::Vector3d::UnitY()) *
                  link_from_optical;
  return pose;
}

/// The camera's pose in the first camera's frame after the vehicle has driven straight on.
odometry::VoResult After(double way_m, const Eigen::Isometry3d& true_mounting) {
  odometry::VoResult result;
  Eigen::Isometry3d first_base_from_base = Eigen::Isometry3d::Identity();
  first_base_from_base.translation().x() = way_m;
  result.world_from_camera = true_mounting.inverse() * first_base_from_base * true_mounting;
  return result;
}

TEST(OdometryConversions, AMountingThatChangesLetsThePathGoOnWhereItWas) {
  const Eigen::Isometry3d truth = Mounted(4, 3, 1.4);
  OdometryFrames frames;
  frames.base_from_optical = Mounted(0, 0, 1.4);  // As was said at first.
  const Eigen::Isometry3d before = OdomFromBase(After(100, truth), frames);
  ChangeMounting(After(100, truth).world_from_camera, truth, frames);
  const Eigen::Isometry3d after = OdomFromBase(After(100, truth), frames);
  // The lever of 1.5 m alone moves the base.
  EXPECT_LT((after.translation() - before.translation()).norm(), 0.2);
  EXPECT_NEAR(after.linear()(2, 2), 1, 1e-9) << "odom is level";
  // It goes on into the direction of the path before, which is now where its front points.
  const Eigen::Isometry3d later = OdomFromBase(After(150, truth), frames);
  const Eigen::Vector3d way = later.translation() - after.translation();
  EXPECT_NEAR(way.norm(), 50, 1e-6);
  EXPECT_NEAR(std::atan2(way.y(), way.x()), -4 * kDegree, 0.1 * kDegree);
  EXPECT_NEAR(std::atan2(after.linear()(1, 0), after.linear()(0, 0)), -4 * kDegree, 0.1 * kDegree);
}

TEST(OdometryConversions, AMountingThatStaysChangesNothing) {
  const Eigen::Isometry3d truth = Mounted(1, 2, 1.5);
  OdometryFrames frames;
  frames.base_from_optical = truth;
  ChangeMounting(After(30, truth).world_from_camera, truth, frames);
  EXPECT_TRUE(frames.odom_from_first_base.isApprox(Eigen::Isometry3d::Identity(), 1e-9));
}

}  // namespace
}  // namespace livemap::ros_io
