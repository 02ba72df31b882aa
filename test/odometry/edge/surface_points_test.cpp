#include "odometry/edge/surface_points.h"

#include <gtest/gtest.h>

#include <limits>

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

TEST(SurfacePoints, AgreeWhereTheMotionIsTrue) {
  SurfacePoints points;
  points.Take(BlockBeforeWall(), kWallCamera);
  const auto agreement =
      points.Agreement(FrameOf(BlockBeforeWall()), kWallCamera, Pose(0, 0, 0, 0, 0, 0));
  ASSERT_TRUE(agreement);
  EXPECT_GT(*agreement, 0.99);
}

TEST(SurfacePoints, ContradictAMoveAlongTheAxisAndAcrossAnEdge) {
  SurfacePoints points;
  points.Take(BlockBeforeWall(), kWallCamera);
  const RgbdFrame frame = FrameOf(BlockBeforeWall());
  EXPECT_LT(points.Agreement(frame, kWallCamera, Pose(0, 0, 0.2, 0, 0, 0)).value(), 0.1);
  EXPECT_LT(points.Agreement(frame, kWallCamera, Pose(0.4, 0, 0, 0, 0, 0)).value(), 0.85);
}

TEST(SurfacePoints, SixteenBitsSayTheSame) {
  SurfacePoints points;
  points.Take(BlockBeforeWall(), kWallCamera);
  RgbdFrame frame = FrameOf(BlockBeforeWall());
  const Eigen::Isometry3d motion = Pose(0.2, 0, 0, 0, 0, 0);
  const auto by_float = points.Agreement(frame, kWallCamera, motion);
  frame.depth.convertTo(frame.depth, CV_16UC1, 5000);
  frame.depth_units_per_m = 5000;
  EXPECT_EQ(points.Agreement(frame, kWallCamera, motion), by_float);
}

TEST(SurfacePoints, SayNothingWhereNothingIsMeasured) {
  SurfacePoints points;
  points.Take(BlockBeforeWall(), kWallCamera);
  const Eigen::Isometry3d still = Pose(0, 0, 0, 0, 0, 0);
  EXPECT_FALSE(points.Agreement(RgbdFrame(), kWallCamera, still));
  const cv::Mat blind = cv::Mat::zeros(BlockBeforeWall().size(), CV_32FC1);
  EXPECT_FALSE(points.Agreement(FrameOf(blind), kWallCamera, still));
  EXPECT_FALSE(points.Agreement(FrameOf(BlockBeforeWall()), kWallCamera, Pose(0, 0, -5, 0, 0, 0)));
  points.Clear();
  EXPECT_FALSE(points.Agreement(FrameOf(BlockBeforeWall()), kWallCamera, still));
}

TEST(SurfacePoints, APixelBesideTheRightOneSaysTheSame) {
  SurfacePoints points;
  points.Take(DepthOfCorner(Pose(0, 0, 0, 0, 0, 0)), kWallCamera);
  const Eigen::Isometry3d motion = Pose(0.013, -0.007, 0.005, 0.011, 0.02, 0.003);
  const RgbdFrame frame = FrameOf(DepthOfCorner(motion));
  SurfacePoints::Distances distances;
  points.Measure(frame, kWallCamera, motion.inverse(), 1, distances);
  EXPECT_GT(distances.CountMeasured(), 800U);
  EXPECT_LT(distances.Sigma(), 1e-3);
  EXPECT_GT(distances.ShareWithin(0.01), 0.95);
}

TEST(SurfacePoints, DistancesAreCountedAndRobust) {
  SurfacePoints::Distances distances;
  EXPECT_EQ(distances.CountMeasured(), 0U);
  EXPECT_EQ(distances.Sigma(), std::numeric_limits<double>::infinity());
  for (const float distance : {0.1F, -0.1F, 0.1F, -0.1F, 20.0F}) distances.Add(distance);
  distances.Add(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(distances.size(), 6U);
  EXPECT_EQ(distances.CountMeasured(), 5U);
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
    SurfacePoints::Distances before, behind;
    points.Measure(frame, kWallCamera, Se3Exp(twist), 1, before);
    points.Measure(frame, kWallCamera, Se3Exp(-twist), 1, behind);
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
  const auto found = points.NewFromReference(FrameOf(DepthOfCorner(motion)), kWallCamera,
                                             Eigen::Isometry3d::Identity());
  ASSERT_TRUE(found);
  EXPECT_LT((found->inverse().translation() - motion.translation()).norm(), 1e-3);
  EXPECT_LT(Se3Log(*found * motion).tail<3>().norm(), 1e-3);
}

TEST(SurfacePoints, AWallTellsTheDistanceToItAndNoSlideAlongIt) {
  SurfacePoints points;
  const cv::Mat wall(kWallCamera.height, kWallCamera.width, CV_32FC1, cv::Scalar(2));
  points.Take(wall, kWallCamera);
  const cv::Mat nearer(kWallCamera.height, kWallCamera.width, CV_32FC1, cv::Scalar(1.95));
  const auto found =
      points.NewFromReference(FrameOf(nearer), kWallCamera, Pose(0.03, 0, 0, 0, 0, 0));
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->translation().x(), 0.03, 1e-3);
  EXPECT_NEAR(found->translation().y(), 0, 1e-3);
  EXPECT_NEAR(found->translation().z(), -0.05, 1e-3);
  const cv::Mat blind = cv::Mat::zeros(wall.size(), CV_32FC1);
  EXPECT_FALSE(points.NewFromReference(FrameOf(blind), kWallCamera, Pose(0, 0, 0, 0, 0, 0)));
}

TEST(SurfaceBound, FollowsTheCameraWithinLimits) {
  EXPECT_EQ(SurfaceBound(0), 0.1);
  EXPECT_NEAR(SurfaceBound(0.1), 0.4, 1e-12);
  EXPECT_EQ(SurfaceBound(2), 1);
  EXPECT_EQ(SurfaceBound(std::numeric_limits<double>::infinity()), 1);
}

}  // namespace
}  // namespace livemap::odometry
