#include "odometry/edge/surface_points.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "odometry/se3.h"
#include "test/odometry/synthetic_scene.h"

namespace livemap::odometry {
namespace {

/// A wall at 2 m with a block in front of its left half, at 1.5 m.
cv::Mat BlockBeforeWall() {
  cv::Mat depth(kWallCamera.height, kWallCamera.width, CV_32FC1, cv::Scalar(2));
  depth.colRange(0, depth.cols / 2).setTo(1.5);
  return depth;
}

RgbdFrame FrameOf(const cv::Mat& depth) {
  RgbdFrame frame;
  frame.depth = depth;
  return frame;
}

MeasuredDepth DepthOf(const RgbdFrame& frame) { return {&frame, &kWallCamera, {}}; }

TEST(SurfacePoints, AgreeWhereTheMotionIsTrue) {
  SurfacePoints points;
  points.Take(BlockBeforeWall(), kWallCamera);
  const RgbdFrame frame = FrameOf(BlockBeforeWall());
  const auto agreement = points.Agreement(DepthOf(frame), Pose(0, 0, 0, 0, 0, 0), 1);
  ASSERT_TRUE(agreement);
  EXPECT_GT(*agreement, 0.99);
}

TEST(SurfacePoints, ContradictAMoveAlongTheAxisAndAcrossAnEdge) {
  SurfacePoints points;
  points.Take(BlockBeforeWall(), kWallCamera);
  const RgbdFrame frame = FrameOf(BlockBeforeWall());
  EXPECT_LT(points.Agreement(DepthOf(frame), Pose(0, 0, 0.2, 0, 0, 0), 1).value(), 0.1);
  EXPECT_LT(points.Agreement(DepthOf(frame), Pose(0.4, 0, 0, 0, 0, 0), 1).value(), 0.85);
}

TEST(SurfacePoints, SixteenBitsSayTheSame) {
  SurfacePoints points;
  points.Take(BlockBeforeWall(), kWallCamera);
  RgbdFrame frame = FrameOf(BlockBeforeWall());
  const Eigen::Isometry3d motion = Pose(0.2, 0, 0, 0, 0, 0);
  const auto by_float = points.Agreement(DepthOf(frame), motion, 1);
  frame.depth.convertTo(frame.depth, CV_16UC1, 5000);
  frame.depth_units_per_m = 5000;
  EXPECT_EQ(points.Agreement(DepthOf(frame), motion, 1), by_float);
}

TEST(SurfacePoints, SayNothingWhereTooLittleIsMeasured) {
  SurfacePoints points;
  points.Take(BlockBeforeWall(), kWallCamera);
  const Eigen::Isometry3d still = Pose(0, 0, 0, 0, 0, 0);
  const RgbdFrame whole = FrameOf(BlockBeforeWall());
  EXPECT_FALSE(points.Agreement(DepthOf(RgbdFrame()), still, 1));
  EXPECT_FALSE(points.Agreement(DepthOf(whole), Pose(0, 0, -5, 0, 0, 0), 1));
  cv::Mat sparse = cv::Mat::zeros(BlockBeforeWall().size(), CV_32FC1);
  EXPECT_FALSE(points.Agreement(DepthOf(FrameOf(sparse)), still, 1));
  sparse(cv::Rect(100, 100, 30, 30)).setTo(1.5);  // A hundredth of the image.
  SurfaceDistances distances;
  points.Measure(DepthOf(FrameOf(sparse)), still, 1, distances);
  EXPECT_EQ(distances.size(), 0U);
  EXPECT_FALSE(points.Agreement(DepthOf(FrameOf(sparse)), still, 1));
  points.Clear();
  EXPECT_FALSE(points.Agreement(DepthOf(whole), still, 1));
}

TEST(SurfacePoints, WhatIsNoDepthIsNotMeasured) {
  SurfacePoints points;
  points.Take(BlockBeforeWall(), kWallCamera);
  const Eigen::Isometry3d still = Pose(0, 0, 0, 0, 0, 0);
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float wrong : {infinity, -infinity, std::numeric_limits<float>::quiet_NaN(),
                            std::numeric_limits<float>::max(), 65.535F * 1000, 0.01F, -1.0F}) {
    RgbdFrame frame = FrameOf(BlockBeforeWall());
    frame.depth.rowRange(0, 150).setTo(wrong);
    SurfaceDistances distances;
    points.Measure(DepthOf(frame), still, 1, distances);
    EXPECT_GT(distances.measured(), 200U) << wrong;
    EXPECT_LT(distances.measured(), distances.size() / 2) << wrong;
    EXPECT_LT(distances.Sigma(), 1e-3) << wrong;
    EXPECT_GT(points.Agreement(DepthOf(frame), still, 1).value(), 0.99) << wrong;
  }
}

TEST(SurfacePoints, APixelBesideTheRightOneSaysTheSame) {
  SurfacePoints points;
  points.Take(DepthOfCorner(Pose(0, 0, 0, 0, 0, 0)), kWallCamera);
  const Eigen::Isometry3d motion = Pose(0.013, -0.007, 0.005, 0.011, 0.02, 0.003);
  const RgbdFrame frame = FrameOf(DepthOfCorner(motion));
  SurfaceDistances distances;
  points.Measure(DepthOf(frame), motion.inverse(), 1, distances);
  EXPECT_GT(distances.measured(), 800U);
  EXPECT_LT(distances.Sigma(), 1e-3);
  EXPECT_GT(distances.ShareWithin(0.01), 0.95);
}

TEST(SurfaceDistances, AreCountedAndRobust) {
  SurfaceDistances distances;
  EXPECT_EQ(distances.measured(), 0U);
  EXPECT_EQ(distances.Sigma(), std::numeric_limits<double>::infinity());
  EXPECT_EQ(distances.ShareWithin(1), 0);
  for (const float distance : {0.1F, -0.1F, 0.1F, -0.1F, 20.0F}) distances.Add(distance);
  distances.Add(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(distances.size(), 6U);
  EXPECT_EQ(distances.measured(), 5U);
  EXPECT_NEAR(distances.Sigma(), 0.14826, 1e-4);
  EXPECT_NEAR(distances.ShareWithin(0.2), 0.8, 1e-9);
}

TEST(SurfacePoints, JacobianIsTheDerivativeOfTheDistanceByTheTwist) {
  SurfacePoints points;
  points.Take(DepthOfCorner(Pose(0, 0, 0, 0, 0, 0)), kWallCamera);
  const RgbdFrame frame = FrameOf(DepthOfCorner(Pose(0, 0, 0, 0, 0, 0)));
  const double step = 1e-3;
  for (int i = 0; i < 6; ++i) {
    Vector6d twist = Vector6d::Zero();
    twist[i] = step;
    SurfaceDistances before, behind;
    points.Measure(DepthOf(frame), Se3Exp(twist), 1, before);
    points.Measure(DepthOf(frame), Se3Exp(-twist), 1, behind);
    std::size_t compared = 0, alike = 0;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const double numeric = (behind[k] - before[k]) / (2 * step);
      if (std::isnan(numeric)) continue;
      ++compared;
      alike += std::abs(numeric - points.Jacobian(k)[i]) < 0.5 ? 1U : 0U;  // Of 20 to 60 per m.
    }
    EXPECT_GT(compared, 800U);
    EXPECT_GT(alike, compared * 95 / 100) << "component " << i;
  }
}

TEST(SurfacePoints, ACornerTellsTheMotion) {
  SurfacePoints points;
  points.Take(DepthOfCorner(Pose(0, 0, 0, 0, 0, 0)), kWallCamera);
  const Eigen::Isometry3d motion = Pose(0.1, -0.05, 0.08, 0.02, 0.05, 0.01);
  const RgbdFrame frame = FrameOf(DepthOfCorner(motion));
  const auto found = points.NewFromReference(DepthOf(frame), Eigen::Isometry3d::Identity());
  ASSERT_TRUE(found);
  EXPECT_LT((found->inverse().translation() - motion.translation()).norm(), 1e-3);
  EXPECT_LT(Se3Log(*found * motion).tail<3>().norm(), 1e-3);
}

TEST(SurfacePoints, AWallTellsTheDistanceToItAndNoSlideAlongIt) {
  SurfacePoints points;
  const cv::Mat wall(kWallCamera.height, kWallCamera.width, CV_32FC1, cv::Scalar(2));
  points.Take(wall, kWallCamera);
  const cv::Mat nearer(kWallCamera.height, kWallCamera.width, CV_32FC1, cv::Scalar(1.95));
  const RgbdFrame frame = FrameOf(nearer);
  const auto found = points.NewFromReference(DepthOf(frame), Pose(0.03, 0, 0, 0, 0, 0));
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->translation().x(), 0.03, 1e-3);
  EXPECT_NEAR(found->translation().y(), 0, 1e-3);
  EXPECT_NEAR(found->translation().z(), -0.05, 1e-3);
  const RgbdFrame blind = FrameOf(cv::Mat::zeros(wall.size(), CV_32FC1));
  EXPECT_FALSE(points.NewFromReference(DepthOf(blind), Pose(0, 0, 0, 0, 0, 0)));
}

TEST(SurfaceBound, FollowsTheCameraWithinLimits) {
  EXPECT_EQ(SurfaceBound(0), 0.1);
  EXPECT_NEAR(SurfaceBound(0.1), 0.4, 1e-12);
  EXPECT_EQ(SurfaceBound(2), 1);
  EXPECT_EQ(SurfaceBound(std::numeric_limits<double>::infinity()), 1);
}

}  // namespace
}  // namespace livemap::odometry
