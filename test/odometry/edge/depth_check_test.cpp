#include "odometry/edge/depth_check.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace livemap::odometry
