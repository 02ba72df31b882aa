#include "simulation/room/simulated_room.h"

#include <gtest/gtest.h>

#include <cmath>

#include "simulation/room/room_motion.h"
#include "test/simulation/render/same_pixels.h"

namespace livemap::simulation {
namespace {

constexpr RoomMotion kMotions[] = {RoomMotion::kHand,     RoomMotion::kWalking,
                                   RoomMotion::kFastTurn, RoomMotion::kShake,
                                   RoomMotion::kCar,      RoomMotion::kFromSpeed};

SimulatedCamera RoomCamera() {
  SimulatedCamera camera;
  camera.intrinsics = {80, 80, 79.5, 59.5, 160, 120};
  return camera;
}

Eigen::Isometry3d HandPose(const SimulatedRoom& room, double time_s) {
  return RoomCameraPose(room.plan(), RoomMotion::kHand, time_s, 1);
}

TEST(SimulatedRoom, TheSameSeedGivesTheSamePixelsWhateverTheThreads) {
  const SimulatedRoom first(3), second(3), other(4);
  const Eigen::Isometry3d pose = HandPose(first, 0.4);
  const SimulatedFrame frame = first.Render(RoomCamera(), pose, 7, 1, 2, 1);
  const SimulatedFrame again = second.Render(RoomCamera(), pose, 7, 1, 2, 2);
  EXPECT_TRUE(SamePixels(frame.bgr, again.bgr));
  EXPECT_TRUE(SamePixels(frame.depth, again.depth));
  EXPECT_FALSE(SamePixels(frame.bgr, other.Render(RoomCamera(), pose, 7, 1, 2, 1).bgr));
}

TEST(SimulatedRoom, DepthIsThatOfTheSamePointsFromEverywhere) {
  const SimulatedRoom room(5);
  const SimulatedCamera camera = RoomCamera();
  const SimulatedFrame first = room.Render(camera, HandPose(room, 0), 0, 1, 1, 2);
  const SimulatedFrame second = room.Render(camera, HandPose(room, 0.5), 1, 1, 1, 2);
  const Eigen::Isometry3d second_from_first =
      second.world_from_optical.inverse() * first.world_from_optical;
  int near = 0, total = 0;
  for (int y = 10; y < 110; ++y) {
    for (int x = 10; x < 150; ++x) {
      const double depth = first.depth.at<float>(y, x);
      ASSERT_TRUE(std::isfinite(depth)) << "walls are all around";
      const Eigen::Vector3d point = second_from_first * (depth * camera.Ray(x, y));
      const Eigen::Vector2d pixel = camera.Project(point);
      const int column = static_cast<int>(std::lround(pixel.x()));
      const int row = static_cast<int>(std::lround(pixel.y()));
      if (column < 0 || row < 0 || column >= 160 || row >= 120) continue;
      ++total;
      near += std::abs(second.depth.at<float>(row, column) - point.z()) < 0.05 ? 1 : 0;
    }
  }
  ASSERT_GT(total, 10000);
  EXPECT_GT(near, 0.93 * total) << "but for what is hidden from one of both";
}

TEST(SimulatedRoom, ARollingShutterSeesTheLastRowFromWhereTheCameraIsThen) {
  const SimulatedRoom room(2);
  const Eigen::Isometry3d begin = HandPose(room, 0), end = HandPose(room, 1);
  const SimulatedFrame rolling = room.Render(RoomCamera(), begin, 0, 1, 1, 1, end);
  const SimulatedFrame first = room.Render(RoomCamera(), begin, 0, 1, 1, 1);
  const SimulatedFrame last = room.Render(RoomCamera(), end, 0, 1, 1, 1);
  const auto difference = [&](const SimulatedFrame& frame, int row) {
    return cv::norm(rolling.bgr.row(row), frame.bgr.row(row), cv::NORM_L1) / (3 * 160);
  };
  EXPECT_LT(difference(first, 0), 0.1);
  EXPECT_LT(difference(last, 119), 0.1);
  EXPECT_GT(difference(first, 60), 1);
}

TEST(SimulatedRoom, AVariedRoomLeavesItsCameraRoom) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    for (const RoomMotion motion : kMotions) {
      const RoomPlan plan =
          VariedRoomPlan(seed, motion == RoomMotion::kCar ? RoomScale::kHall : RoomScale::kRoom);
      for (double time_s = 0; time_s < 3; time_s += 0.1) {
        const Vec3 at = RoomCameraPose(plan, motion, time_s, 3).translation().cast<float>();
        EXPECT_LT(std::abs(at.x()) + 0.3F, plan.half_size.x()) << seed;
        EXPECT_LT(std::abs(at.y()) + 0.3F, plan.half_size.y()) << seed;
        for (const RoomBox& box : plan.boxes) {
          EXPECT_FALSE((at.array() > box.low.array() - 0.1F).all() &&
                       (at.array() < box.high.array() + 0.1F).all())
              << seed << ": the camera is inside of a box";
        }
      }
    }
  }
}

TEST(SimulatedRoom, VariedRoomsDifferInSizeAndRepeatPatterns) {
  const RoomPlan one = VariedRoomPlan(1, RoomScale::kRoom);
  const RoomPlan other = VariedRoomPlan(2, RoomScale::kRoom);
  EXPECT_NE(one.half_size, other.half_size);
  EXPECT_NE(one.boxes.size(), other.boxes.size());
  int patterned = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (const auto& axis : VariedRoomPlan(seed, RoomScale::kRoom).faces) {
      for (const RoomFinish& face : axis) patterned += face.pattern != RoomPattern::kNone ? 1 : 0;
    }
  }
  EXPECT_GT(patterned, 40) << "of 120";
  EXPECT_LT(patterned, 80);
}

TEST(RoomCameraPose, ACalmHandMovesGently) {
  const SimulatedRoom room(1);
  for (double time_s = 0; time_s < 20; time_s += 0.1) {
    const Eigen::Isometry3d step = HandPose(room, time_s).inverse() * HandPose(room, time_s + 0.1);
    EXPECT_LT(step.translation().norm(), 0.03);
    EXPECT_LT(Eigen::AngleAxisd(step.linear()).angle(), 0.02);
  }
}

TEST(RoomCameraPose, FromSpeedIsInFullMotionAtTheFirstPicture) {
  const RoomPlan plan = VariedRoomPlan(3, RoomScale::kRoom);
  const auto step = [&](double time_s) {
    return RoomCameraPose(plan, RoomMotion::kFromSpeed, time_s, 1).inverse() *
           RoomCameraPose(plan, RoomMotion::kFromSpeed, time_s + 1 / 30.0, 1);
  };
  for (const double time_s : {0.0, 1.0}) {
    EXPECT_NEAR(step(time_s).translation().norm(), 0.025, 0.01);
    EXPECT_NEAR(Eigen::AngleAxisd(step(time_s).linear()).angle() * 180 / M_PI, 0.6, 0.01);
  }
}

TEST(RoomCameraPose, MotionsAreKnownByName) {
  for (const char* name : {"hand", "walking", "fast-turn", "shake", "car", "from-speed"}) {
    EXPECT_TRUE(ParseRoomMotion(name)) << name;
  }
  EXPECT_FALSE(ParseRoomMotion("flying"));
}

}  // namespace
}  // namespace livemap::simulation
