#include "box_walk.h"

#include <cmath>
#include <random>
#include <string>

#include "common/error.h"

namespace livemap::bench {
namespace {

constexpr double kMostSpeedMps = 0.75;
constexpr double kMostTurnRps = 18 * M_PI / 180;
constexpr double kLeastClearanceM = 0.5;
constexpr double kLongestS = 60;  // The way is looked along for so long.
constexpr int kAttempts = 400;

}  // namespace

double BoxWalk::Sway::At(double time_s) const {
  return amplitude * std::sin(rate * time_s + phase);
}

BoxWalk::BoxWalk(const BoxRoom& room, std::uint64_t seed, double speed) {
  std::mt19937_64 random(seed ^ 0x5851f42d4c957f2dULL);
  const auto between = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  // At its middle in the first frame or near it: there it is fastest.
  const auto sway = [&](double amplitude, double most_per_s) {
    return Sway{amplitude, most_per_s / amplitude,
                (between(0, 1) < 0.5 ? 0 : M_PI) + between(-0.4, 0.4)};
  };
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    // A room with many boxes has space for short ways only.
    const double shorter = attempt < kAttempts / 2 ? 1 : 0.4;
    const Eigen::Vector3d half = (room.high() - room.low()) / 2;
    middle_ = Eigen::Vector3d(between(-0.4, 0.4) * half.x(), between(-0.4, 0.4) * half.y(),
                              between(0.9, 1.1) * half.z());
    heading_rad_ = between(-M_PI, M_PI);
    // The squares of the three speeds add up to that of the whole.
    Eigen::Vector3d share(between(0.3, 1), between(0.3, 1), between(0.05, 0.25));
    share.normalize();
    along_ = sway(shorter * between(0.5, 1.2), share.x() * speed * kMostSpeedMps);
    across_ = sway(shorter * between(0.4, 1.0), share.y() * speed * kMostSpeedMps);
    up_ = sway(between(0.1, 0.3), share.z() * speed * kMostSpeedMps);
    yaw_ = sway(between(0.5, 1.5), 0.95 * speed * kMostTurnRps);
    pitch_ = sway(between(0.05, 0.2), 0.25 * speed * kMostTurnRps);
    roll_ = sway(between(0.05, 0.15), 0.2 * speed * kMostTurnRps);
    bool clear = true;
    for (double time_s = 0; time_s < kLongestS && clear; time_s += 0.02 / speed) {
      clear = room.Clearance(Place(time_s)) > kLeastClearanceM;
    }
    if (clear) return;
  }
  throw Error("no walk stays clear of the walls and boxes of the room of seed " +
              std::to_string(seed));
}

Eigen::Vector3d BoxWalk::Place(double time_s) const {
  const Eigen::AngleAxisd turn(heading_rad_, Eigen::Vector3d::UnitZ());
  return middle_ + turn * Eigen::Vector3d(along_.At(time_s), across_.At(time_s), up_.At(time_s));
}

Eigen::Isometry3d BoxWalk::At(double time_s) const {
  // The optical frame of a level camera that looks along x: right, down, forward.
  Eigen::Matrix3d level;
  level << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  world_from_camera.translation() = Place(time_s);
  world_from_camera.linear() =
      Eigen::AngleAxisd(heading_rad_ + yaw_.At(time_s), Eigen::Vector3d::UnitZ()) *
      Eigen::AngleAxisd(pitch_.At(time_s), Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(roll_.At(time_s), Eigen::Vector3d::UnitX()) * level;
  return world_from_camera;
}

}  // namespace livemap::bench
