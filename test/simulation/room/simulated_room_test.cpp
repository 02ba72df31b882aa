#include "simulation/room/simulated_room.h"

#include <gtest/gtest.h>

#include <cmath>

#include "test/simulation/render/same_pixels.h"

namespace livemap::simulation {
namespace {

SimulatedCamera RoomCamera() {
  SimulatedCamera camera;
  camera.intrinsics = {80, 80, 79.5, 59.5, 160, 120};
  return camera;
}

TEST(SimulatedRoom, TheSameSeedGivesTheSamePixelsWhateverTheThreads) {
  const SimulatedRoom first(3), second(3), other(4);
  const Eigen::Isometry3d pose = first.WorldFromOptical(0.4, 1);
  const SimulatedFrame frame = first.Render(RoomCamera(), pose, 7, 1, 2, 1);
  const SimulatedFrame again = second.Render(RoomCamera(), pose, 7, 1, 2, 2);
  EXPECT_TRUE(SamePixels(frame.bgr, again.bgr));
  EXPECT_TRUE(SamePixels(frame.depth, again.depth));
  EXPECT_FALSE(SamePixels(frame.bgr, other.Render(RoomCamera(), pose, 7, 1, 2, 1).bgr));
}

TEST(SimulatedRoom, DepthIsThatOfTheSamePointsFromEverywhere) {
  const SimulatedRoom room(5);
  const SimulatedCamera camera = RoomCamera();
  const SimulatedFrame first = room.Render(camera, room.WorldFromOptical(0, 1), 0, 1, 1, 2);
  const SimulatedFrame second = room.Render(camera, room.WorldFromOptical(0.5, 1), 1, 1, 1, 2);
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

TEST(SimulatedRoom, ACalmHandMovesGently) {
  const SimulatedRoom room(1);
  for (double time_s = 0; time_s < 20; time_s += 0.1) {
    const Eigen::Isometry3d step =
        room.WorldFromOptical(time_s, 1).inverse() * room.WorldFromOptical(time_s + 0.1, 1);
    EXPECT_LT(step.translation().norm(), 0.03);
    EXPECT_LT(Eigen::AngleAxisd(step.linear()).angle(), 0.02);
  }
}

}  // namespace
}  // namespace livemap::simulation
