#include "odometry/monocular/two_view_start.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <vector>

#include "odometry/se3.h"
#include "simulation/room/room_motion.h"
#include "simulation/room/simulated_room.h"

namespace livemap::odometry {
namespace {

using Verdict = TwoViewStart::Verdict;

constexpr int kStartFrames = 14;

simulation::SimulatedCamera StartTestCamera() {
  simulation::SimulatedCamera camera;
  camera.intrinsics = {250, 250, 159.5, 119.5, 320, 240};
  return camera;
}

/// Where the camera is: sideways and forward by 4 cm per frame.
Eigen::Isometry3d FirstFromFrame(int frame) {
  Vector6d twist;
  twist << 0.032, 0, 0.024, 0, 0.003, 0;
  return Se3Exp(twist * frame);
}

const std::vector<cv::Mat>& StartPictures() {
  static const std::vector<cv::Mat> pictures = [] {
    const simulation::SimulatedRoom room(2);
    const Eigen::Isometry3d start =
        RoomCameraPose(room.plan(), simulation::RoomMotion::kHand, 0, 1);
    std::vector<cv::Mat> made(kStartFrames);
    for (int i = 0; i < kStartFrames; ++i) {
      const simulation::SimulatedFrame seen = room.Render(
          StartTestCamera(), start * FirstFromFrame(i), static_cast<std::uint32_t>(i), 1.3F, 1, 2);
      cv::cvtColor(seen.bgr, made[static_cast<std::size_t>(i)], cv::COLOR_BGR2GRAY);
    }
    return made;
  }();
  return pictures;
}

/// A start by the walk's first frames, and which one is its second.
struct Started {
  TwoViewStart start;
  int second = 0;

  explicit Started(const TwoViewStart::Config& config = TwoViewStart::Config())
      : start(config, StartTestCamera().intrinsics) {
    start.Begin(StartPictures()[0]);
    do {
      ++second;
    } while (second + 1 < kStartFrames &&
             !start.Follow(StartPictures()[static_cast<std::size_t>(second)]));
  }
  /// The true motion to a frame, turned by so much about the vertical axis, in units of the start.
  Eigen::Isometry3d Motion(int frame, double turn_rad) const {
    Vector6d turn = Vector6d::Zero();
    turn[4] = turn_rad;
    Eigen::Isometry3d motion = Se3Exp(turn) * FirstFromFrame(frame).inverse();
    motion.translation() /= FirstFromFrame(second).translation().norm();
    return motion;
  }
  Verdict Check(int frame, double turn_rad = 0) {
    return start.Check(StartPictures()[static_cast<std::size_t>(frame)], Motion(frame, turn_rad));
  }
};

TEST(TwoViewStart, ALongerBaselineTakesTheShortOnesPlaceUntilDepthsAreCertain) {
  Started started;
  ASSERT_TRUE(started.start.IsProvisional());
  const double at_first = started.start.DepthSigma();
  ASSERT_GT(at_first, TwoViewStart::Config().enough_depth_sigma);
  Verdict verdict = Verdict::kOpen;
  int remade = 0;
  for (int i = started.second + 1; i < kStartFrames && verdict != Verdict::kHolds; ++i) {
    verdict = started.Check(i);
    if (verdict != Verdict::kRemake) continue;
    const auto motion = started.start.Remake();
    ASSERT_TRUE(motion);
    const Eigen::Vector3d direction = FirstFromFrame(i).inverse().translation().normalized();
    EXPECT_GT(motion->translation().dot(direction), 0.99) << "frame " << i;
    started.second = i;
    ++remade;
  }
  EXPECT_GE(remade, 1);
  EXPECT_EQ(verdict, Verdict::kHolds);
  EXPECT_FALSE(started.start.IsProvisional());
  EXPECT_LE(started.start.DepthSigma(), TwoViewStart::Config().enough_depth_sigma);
}

TEST(TwoViewStart, TwoPosesThatTheCornersContradictRefuteIt) {
  TwoViewStart::Config config;
  config.enough_depth_sigma = 1e9;  // A longer baseline is no reason by itself.
  Started started(config);
  constexpr double kWrongTurnRad = 0.03;
  EXPECT_EQ(started.Check(started.second + 1, kWrongTurnRad), Verdict::kOpen);
  EXPECT_EQ(started.Check(started.second + 2, kWrongTurnRad), Verdict::kRemake);
}

TEST(TwoViewStart, ARefutedOneWithoutCornersFails) {
  Started started;
  started.Check(started.second + 1, 0.03);
  started.Check(started.second + 1, 0.03);
  const cv::Mat dark(240, 320, CV_8UC1, cv::Scalar(0));
  EXPECT_EQ(started.start.Check(dark, started.Motion(started.second + 2, 0)), Verdict::kFails);
  EXPECT_FALSE(started.start.IsProvisional());
}

}  // namespace
}  // namespace livemap::odometry
