#include "odometry/edge/wide_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "odometry/edge/edge_odometry.h"
#include "odometry/edge/feature_motion.h"
#include "odometry/edge/shift_search.h"
#include "simulation/room/room_motion.h"
#include "simulation/room/simulated_room.h"
#include "simulation/sensors/depth_sensor.h"
#include "test/odometry/chequered_wall.h"
#include "test/odometry/synthetic_scene.h"

namespace livemap::odometry {
namespace {

using simulation::DepthSensor;
using simulation::RoomMotion;

/// A camera that moves through a varied room.
class MovingThroughRoom {
 public:
  MovingThroughRoom(std::uint64_t seed, RoomMotion motion, double vigour,
                    DepthSensor sensor = DepthSensor::kExact)
      : room_(simulation::VariedRoomPlan(seed, simulation::RoomScale::kRoom)),
        motion_(motion),
        vigour_(vigour),
        sensor_(sensor) {}

  const geo::CameraIntrinsics& camera() const { return camera_.intrinsics; }
  Eigen::Isometry3d Truth(double time_s) const {
    return simulation::RoomCameraPose(room_.plan(), motion_, time_s, vigour_);
  }
  RgbdFrame See(double time_s) const {
    const auto number = static_cast<std::uint32_t>(std::lround(30 * time_s));
    const simulation::SimulatedFrame seen =
        room_.Render(camera_, Truth(time_s), number, 1.3F, 1, 2);
    RgbdFrame frame;
    frame.stamp_ns = 1'000'000'000 + static_cast<std::int64_t>(1e9 * time_s);
    cv::cvtColor(seen.bgr, frame.grey, cv::COLOR_BGR2GRAY);
    frame.depth = simulation::SenseDepth(seen.depth, camera(), sensor_, 0, number);
    return frame;
  }
  /// Largest error of a position over so many frames; every one must be tracked.
  double WorstErrorM(int frames, double step_s, double from_s = 0) const {
    EdgeOdometry odometry({}, camera());
    double worst_m = 0;
    for (int i = 0; i < frames; ++i) {
      const double time_s = from_s + i * step_s;
      const VoResult result = odometry.Track(See(time_s));
      EXPECT_EQ(result.state, VoState::kTracking) << i;
      const Eigen::Isometry3d truth = Truth(from_s).inverse() * Truth(time_s);
      worst_m =
          std::max(worst_m, (result.world_from_camera.translation() - truth.translation()).norm());
    }
    return worst_m;
  }

 private:
  simulation::SimulatedRoom room_;
  RoomMotion motion_;
  double vigour_;
  DepthSensor sensor_;
  simulation::SimulatedCamera camera_;
};

TEST(ShiftSearch, FindsAShiftInOtherLight) {
  const SyntheticWall wall(kWallCamera);
  const cv::Mat picture = wall.See(0, Pose(0, 0, 0, 0, 0, 0)).grey;
  cv::Mat reference = picture(cv::Rect(20, 30, 80, 60)).clone();
  cv::Mat moved = picture(cv::Rect(15, 33, 80, 60)).clone();
  moved.convertTo(moved, CV_8U, 0.6, 40);
  ShiftSearch search;
  const ShiftSearch::Shifts shifts = search.Find(reference, moved);
  ASSERT_GT(shifts.count, 0U);
  EXPECT_EQ(shifts.best[0].x, 5);
  EXPECT_EQ(shifts.best[0].y, -3);
}

TEST(ShiftSearch, FindsNothingInACoveredLens) {
  const cv::Mat grey = SyntheticWall(kWallCamera).See(0, Pose(0, 0, 0, 0, 0, 0)).grey;
  const cv::Mat reference = grey(cv::Rect(0, 0, 80, 60));
  ShiftSearch search;
  EXPECT_EQ(search.Find(reference, cv::Mat(60, 80, CV_8UC1, cv::Scalar(3))).count, 0U);
}

TEST(FeatureMotion, FindsAWideMotionAndTheSameOneAgain) {
  const MovingThroughRoom moving(6, RoomMotion::kWalking, 1.5);
  const RgbdFrame first = moving.See(1.0), second = moving.See(1.2);
  PictureFeatures reference, picture;
  FindFeatures(first.grey, reference);
  FindFeatures(second.grey, picture);
  const auto motion = NewFromReferenceByFeatures(reference, first.depth, picture, moving.camera());
  ASSERT_TRUE(motion);
  const Eigen::Isometry3d truth = moving.Truth(1.2).inverse() * moving.Truth(1.0);
  EXPECT_GT(truth.translation().norm(), 0.2);
  EXPECT_LT((motion->translation() - truth.translation()).norm(), 0.1);
  EXPECT_EQ(NewFromReferenceByFeatures(reference, first.depth, picture, moving.camera())->matrix(),
            motion->matrix());
}

TEST(WideSearch, ARepeatedPatternIsNotFollowedIntoItsNextPeriod) {
  EXPECT_LT(MovingThroughRoom(10, RoomMotion::kShake, 1).WorstErrorM(10, 1 / 30.0), 0.004);
}

TEST(WideSearch, ACameraThatMovesFromTheFirstFrameOnIsFollowed) {
  EXPECT_LT(MovingThroughRoom(14, RoomMotion::kFromSpeed, 2).WorstErrorM(6, 1 / 30.0), 0.006);
}

TEST(WideSearch, WideStepsAreFollowed) {
  EXPECT_LT(MovingThroughRoom(6, RoomMotion::kWalking, 1.5).WorstErrorM(7, 4 / 30.0), 0.01);
}

TEST(WideSearch, HalfOfABareWallIsNotFollowedIntoAFalseMinimum) {
  const MovingThroughRoom moving(17, RoomMotion::kWalking, 2, DepthSensor::kKinect);
  EXPECT_LT(moving.WorstErrorM(5, 4 / 30.0, 24 / 30.0), 0.05);
}

TEST(WideSearch, AStepOfAQuarterOfTheViewAlongStripesIsFollowed) {
  const MovingThroughRoom moving(37, RoomMotion::kWalking, 2, DepthSensor::kKinect);
  EXPECT_LT(moving.WorstErrorM(5, 4 / 30.0, 20 / 30.0), 0.02);
}

TEST(WideSearch, AMoveAndATurnAtOncePastStripesAreFollowed) {
  const MovingThroughRoom moving(320, RoomMotion::kFromSpeed, 3);
  EXPECT_LT(moving.WorstErrorM(3, 5 / 30.0), 0.005);
}

TEST(WideSearch, ATurnOf24DegreesToABareWallIsFollowed) {
  const MovingThroughRoom moving(339, RoomMotion::kFastTurn, 2);
  EXPECT_LT(moving.WorstErrorM(3, 4 / 30.0), 0.005);
}

TEST(WideSearch, AMotionThatWasFollowedIsNotForgottenOverTwoRivals) {
  const MovingThroughRoom moving(267, RoomMotion::kFastTurn, 1);
  EXPECT_LT(moving.WorstErrorM(5, 4 / 30.0, 40 / 30.0), 0.01);
}

/// By how much the position after a sudden start along a wall of checks is wrong, m.
double ErrorAfterStepsAlongChecks(double unlikeness) {
  const ChequeredWall wall(unlikeness);
  EdgeOdometry odometry({}, kWallCamera);
  const auto truth = [](int frame) { return Pose(0.43 * frame, 0.17 * frame, 0, 0, 0, 0); };
  VoResult result;
  for (int frame = 0; frame < 4; ++frame) {
    result = odometry.Track(wall.See(1'000'000'000 + frame * 100'000'000LL, truth(frame)));
    EXPECT_EQ(result.state, VoState::kTracking) << frame;
  }
  return (result.world_from_camera.translation() - truth(3).translation()).norm();
}

TEST(WideSearch, ChecksWithShadesOfTheirOwnAreToldApart) {
  EXPECT_LT(ErrorAfterStepsAlongChecks(8), 0.005);
}

TEST(WideSearch, AnEdgeThatFadesToNothingIsNotExplained) {
  AlignmentState state;
  EXPECT_TRUE(IsBelievableLight(state));
  state.gain = 0.25;
  EXPECT_FALSE(IsBelievableLight(state));
  state.gain = 4;
  EXPECT_FALSE(IsBelievableLight(state));
}

TEST(WideSearch, AMoveThatBringsAllPointsIntoOnePixelIsNotBelieved) {
  EXPECT_TRUE(IsBelievableMove(Pose(0.4, 0, 1.5, 0, 0, 0.3), 0.5));
  EXPECT_FALSE(IsBelievableMove(Pose(0, 0, 40, 0, 0, 0), 0.5));
}

TEST(ExplainedScore, LookingAwayExplainsNothing) {
  AlignmentResult all, few;
  all.points = few.points = 1000;
  all.visible = 1000;
  all.explained = 900;
  few.visible = few.explained = 120;
  EXPECT_GT(ExplainedScore(all), ExplainedScore(few));
}

}  // namespace
}  // namespace livemap::odometry
