#include "placement/depth_ground_contact.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::placement {
namespace {

constexpr float kNanF = std::numeric_limits<float>::quiet_NaN();
constexpr double kHeightM = 1.5;
constexpr double kForwardM = 1.2;

/// A camera that looks ahead and down by so much.
Eigen::Isometry3d PitchedMounting(double pitch_rad = 0) {
  Eigen::Isometry3d level = Eigen::Isometry3d::Identity();
  level.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  Eigen::Isometry3d mounting = Eigen::Isometry3d::Identity();
  mounting.translation() = Eigen::Vector3d(kForwardM, 0, kHeightM);
  return mounting * Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) * level;
}

double RowOf(double ahead_of_camera_m) { return 199.5 + 500 * kHeightM / ahead_of_camera_m; }

/// A level road from a level camera; above the horizon nothing.
DepthImage LevelRoad() {
  DepthImage image;
  image.depth = cv::Mat(400, 640, CV_32FC1, cv::Scalar(kNanF));
  for (int row = 201; row < 400; ++row) {
    image.depth.row(row) = static_cast<float>(500 * kHeightM / (row - 199.5));
  }
  return image;
}

/// A flat thing so far ahead, with its lower edge there.
imaging::Box FlatThingAt(double ahead_of_camera_m, float height_px = 20) {
  const auto bottom = static_cast<float>(RowOf(ahead_of_camera_m) + 0.5);
  return {305, bottom - height_px, 335, bottom};
}

std::optional<geo::GroundPoint> Foot(const DepthImage& image, const imaging::Box& box,
                                     double pitch_rad = 0) {
  return ContactByDepth(image, box, vehicle::Intrinsics(), PitchedMounting(pitch_rad), {}, {});
}

TEST(ContactByDepth, AgreesWithTheRoadsPlaneOnALevelRoad) {
  for (const double ahead_m : {5.0, 10.0, 20.0}) {
    const auto foot = Foot(LevelRoad(), FlatThingAt(ahead_m));
    ASSERT_TRUE(foot);
    EXPECT_NEAR(foot->position_m.x(), kForwardM + ahead_m, 0.06 * ahead_m);
    EXPECT_NEAR(foot->position_m.y(), 0, 0.02 * ahead_m);
    EXPECT_GT(foot->covariance_m2.determinant(), 0);
  }
}

TEST(ContactByDepth, DoesNotMindAPitchThatThePlaneTakesForDistance) {
  // The vehicle nods by 0.02 rad, which the mounting does not know.
  const imaging::Box box = FlatThingAt(14);
  const Eigen::Vector2d pixel(319.5, box.y_max - 0.5);
  const auto plane = geo::ProjectToGround(pixel, vehicle::Intrinsics(), PitchedMounting(0.02), {});
  const auto foot = Foot(LevelRoad(), box, 0.02);
  ASSERT_TRUE(plane && foot);
  EXPECT_GT(std::abs(plane->position_m.x() - kForwardM - 14), 2.0);
  EXPECT_LT(std::abs(foot->position_m.x() - kForwardM - 14), 0.6);
}

TEST(ContactByDepth, AStandingThingIsAsFarAsItsSurfaceWhateverIsBehindIt) {
  DepthImage image = LevelRoad();
  const imaging::Box box = FlatThingAt(12, 60);
  image.depth(cv::Rect(305, static_cast<int>(box.y_min), 30, 60)) = 11.5F;
  // A hole, and a distant pixel row.
  image.depth(cv::Rect(310, static_cast<int>(box.y_max) - 4, 6, 4)) = kNanF;
  image.depth.row(static_cast<int>(box.y_max) - 2) = 80.0F;
  const auto foot = Foot(image, box);
  ASSERT_TRUE(foot);
  EXPECT_NEAR(foot->position_m.x(), kForwardM + 11.5, 0.01);
  // Its distance does not hang on the box's lower edge: one per cent of it, and the pitch.
  EXPECT_LT(std::sqrt(foot->covariance_m2(0, 0)), 0.15);
}

TEST(ContactByDepth, OnTheRoadTheBoxesEdgeWeighsAsInThePlane) {
  const auto foot = Foot(LevelRoad(), FlatThingAt(12));
  const auto plane = geo::ProjectToGround({319.5, RowOf(12)}, vehicle::Intrinsics(),
                                          PitchedMounting(), {3, 0, 0, 60});
  ASSERT_TRUE(foot && plane);
  const double ratio = std::sqrt(foot->covariance_m2(0, 0) / plane->covariance_m2(0, 0));
  EXPECT_GT(ratio, 0.7);
  EXPECT_LT(ratio, 1.5);
}

TEST(ContactByDepth, CovarianceHoldsTheNoiseOfTheDepth) {
  std::mt19937_64 random(7);
  std::normal_distribution<float> noise(0, 0.25F);
  const imaging::Box box = FlatThingAt(12, 60);
  double squared = 0;
  int count = 0;
  for (int trial = 0; trial < 50; ++trial) {
    DepthImage image = LevelRoad();
    cv::Mat_<float> standing = image.depth(cv::Rect(305, static_cast<int>(box.y_min), 30, 60));
    std::generate(standing.begin(), standing.end(), [&] { return 12.0F + noise(random); });
    const auto foot = Foot(image, box);
    ASSERT_TRUE(foot);
    const double error_m = foot->position_m.x() - kForwardM - 12;
    squared += error_m * error_m / foot->covariance_m2(0, 0);
    ++count;
  }
  EXPECT_LT(squared / count, 1.5) << "never surer than it is";
}

TEST(ContactByDepth, SixteenBitDepthIsInItsUnits) {
  DepthImage image = LevelRoad();
  cv::Mat millimetres;
  cv::patchNaNs(image.depth, 0);
  image.depth.convertTo(millimetres, CV_16UC1, 1000);
  image.depth = millimetres;
  const auto foot = Foot(image, FlatThingAt(10));
  ASSERT_TRUE(foot);
  EXPECT_NEAR(foot->position_m.x(), kForwardM + 10, 0.6);
}

TEST(ContactByDepth, UnknownDepthGivesNothing) {
  const imaging::Box box = FlatThingAt(12, 60);
  DepthImage unknown = LevelRoad();
  unknown.depth.setTo(kNanF);
  EXPECT_FALSE(Foot(unknown, box));
  unknown.depth.setTo(0);
  EXPECT_FALSE(Foot(unknown, box));
  unknown.depth.setTo(std::numeric_limits<float>::infinity());
  EXPECT_FALSE(Foot(unknown, box));
  unknown.depth.setTo(-3);
  EXPECT_FALSE(Foot(unknown, box));
  DepthImage sparse = LevelRoad();
  sparse.depth.setTo(kNanF);
  for (int row = 0; row < 400; row += 3) sparse.depth.row(row).setTo(12);
  EXPECT_TRUE(Foot(sparse, box)) << "a third is enough";
  for (int row = 0; row < 400; row += 6) sparse.depth.row(row).setTo(kNanF);
  EXPECT_FALSE(Foot(sparse, box));
  DepthImage torn = LevelRoad();
  for (int column = 0; column < 640; column += 2) torn.depth.col(column).setTo(40);
  EXPECT_FALSE(Foot(torn, box)) << "half of it is elsewhere";
  DepthImage wall = LevelRoad();
  wall.depth.setTo(60);
  EXPECT_FALSE(Foot(wall, FlatThingAt(6))) << "far below the road";
}

TEST(ContactByDepth, ImagesAndBoxesThatCannotBeGiveNothing) {
  const imaging::Box box = FlatThingAt(12);
  DepthImage image = LevelRoad();
  image.depth = image.depth(cv::Rect(0, 0, 320, 400)).clone();
  EXPECT_FALSE(Foot(image, box)) << "another size";
  image.depth = cv::Mat(400, 640, CV_8UC1, cv::Scalar(12));
  EXPECT_FALSE(Foot(image, box)) << "another type";
  image.depth = cv::Mat();
  EXPECT_FALSE(Foot(image, box));
  EXPECT_FALSE(Foot(LevelRoad(), {kNanF, 10, 30, 40}));
  EXPECT_FALSE(Foot(LevelRoad(), {305, 10, 335, kNanF}));
  EXPECT_FALSE(Foot(LevelRoad(), {-1e9F, 10, 335, 250}));
  EXPECT_FALSE(Foot(LevelRoad(), {305, 300, 335, 4e9F}));
  EXPECT_FALSE(Foot(LevelRoad(), {700, 300, 735, 350})) << "beside the image";
  EXPECT_TRUE(Foot(LevelRoad(), {620, 330, 655, 350})) << "half beside it";
}

}  // namespace
}  // namespace livemap::placement
