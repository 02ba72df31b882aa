#include "odometry/mounting/road_plane.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "test/odometry/mounting/synthetic_road.h"

namespace livemap::odometry {
namespace {

const Mounting kPlaneTruth{Radians(2), Radians(4), Radians(-1.5), 1.37};

struct RoadViews {
  ImagePyramid now, before;
  Eigen::Isometry3d before_from_now = Eigen::Isometry3d::Identity();
};

void LookTwice(const SyntheticRoad& road, double way_m, RoadViews& views) {
  const Eigen::Isometry3d before = road.WorldFromCamera(0), now = road.WorldFromCamera(way_m);
  views.before.Build(road.See(before));
  views.now.Build(road.See(now));
  views.before_from_now = before.inverse() * now;
}

void ExpectTruth(const std::optional<RoadPlane>& plane, double angle_deg, double height_m) {
  ASSERT_TRUE(plane);
  const double off = std::acos(std::min(1.0, plane->down.dot(AxesInCamera(kPlaneTruth).down)));
  EXPECT_LT(off, Radians(angle_deg));
  EXPECT_NEAR(plane->distance, kPlaneTruth.height_m, height_m);
}

TEST(Mounting, AnglesGoToARotationAndBack) {
  const Mounting back = MountingOfRotation(BaseFromOpticalRotation(kPlaneTruth));
  EXPECT_NEAR(back.yaw_rad, kPlaneTruth.yaw_rad, 1e-12);
  EXPECT_NEAR(back.pitch_rad, kPlaneTruth.pitch_rad, 1e-12);
  EXPECT_NEAR(back.roll_rad, kPlaneTruth.roll_rad, 1e-12);
  const Mounting of_axes = MountingOfAxes(AxesInCamera(kPlaneTruth));
  EXPECT_NEAR(of_axes.yaw_rad, kPlaneTruth.yaw_rad, 1e-12);
  EXPECT_NEAR(of_axes.pitch_rad, kPlaneTruth.pitch_rad, 1e-12);
  EXPECT_NEAR(of_axes.roll_rad, kPlaneTruth.roll_rad, 1e-12);
  const VehicleAxes level = AxesInCamera({});
  EXPECT_NEAR(level.forward.z(), 1, 1e-12);
  EXPECT_NEAR(level.down.y(), 1, 1e-12);
  const VehicleAxes down = AxesInCamera({0, Radians(10), 0, 1});
  EXPECT_LT(down.forward.y(), 0);  // A camera that looks down sees forward above its middle.
}

TEST(RoadPlane, IsRefinedToTheTruthFromNearby) {
  RoadViews views;
  LookTwice(SyntheticRoad(kPlaneTruth), 1.0, views);
  const RoadPlaneSearch search({}, kRoadEye);
  Mounting guess = kPlaneTruth;
  guess.pitch_rad += Radians(0.4);
  guess.roll_rad += Radians(0.5);
  guess.height_m *= 1.02;
  ExpectTruth(search.Refine({views.now, views.before, views.before_from_now}, guess), 0.1, 0.01);
}

TEST(RoadPlane, IsFoundByAWideSearchWithoutKnowingRollAndHeight) {
  RoadViews views;
  LookTwice(SyntheticRoad(kPlaneTruth), 1.0, views);
  const RoadPlaneSearch search({}, kRoadEye);
  const Mounting guess{kPlaneTruth.yaw_rad, kPlaneTruth.pitch_rad + Radians(0.7), 0, 1.8};
  ExpectTruth(search.Search({views.now, views.before, views.before_from_now}, guess), 0.1, 0.01);
}

TEST(RoadPlane, IsNotFoundWithoutTextureNorWhereNothingMovesLikeOne) {
  const SyntheticRoad road(kPlaneTruth);
  RoadViews views;
  LookTwice(road, 1.0, views);
  const RoadPlaneSearch search({}, kRoadEye);
  ImagePyramid plain;
  plain.Build(cv::Mat(kRoadEye.height, kRoadEye.width, CV_8UC1, cv::Scalar(90)));
  EXPECT_FALSE(search.Refine({plain, plain, views.before_from_now}, kPlaneTruth));
  EXPECT_FALSE(search.Search({plain, plain, views.before_from_now}, kPlaneTruth));
  cv::Mat other = road.See(road.WorldFromCamera(70.3, 4.1, 0.2));
  cv::flip(other, other, 1);
  ImagePyramid elsewhere;
  elsewhere.Build(other);
  EXPECT_FALSE(search.Refine({views.now, elsewhere, views.before_from_now}, kPlaneTruth));
}

TEST(RoadPlane, IsFittedToDepthWithHolesAndOtherThings) {
  const SyntheticRoad road(kPlaneTruth);
  cv::Mat depth;
  road.See(road.WorldFromCamera(0), &depth);
  depth(cv::Rect(150, 150, 20, 60)).setTo(2.5F);  // Something stands there,
  depth(cv::Rect(100, 200, 30, 30)).setTo(0);     // and holes.
  depth(cv::Rect(0, 0, 320, 5)).setTo(std::numeric_limits<float>::quiet_NaN());
  const Mounting guess{kPlaneTruth.yaw_rad, kPlaneTruth.pitch_rad, 0, 1.6};
  ExpectTruth(FitRoadPlane(depth, kRoadEye, {}, guess), 0.05, 0.005);
  EXPECT_FALSE(FitRoadPlane(cv::Mat(240, 320, CV_32FC1, cv::Scalar(0)), kRoadEye, {}, guess));
}

}  // namespace
}  // namespace livemap::odometry
