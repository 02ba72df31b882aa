#include "recordings/clock/clock_offset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "common/time.h"

namespace livemap::recordings {
namespace {

constexpr std::int64_t kBegin = 1'769'862'896'000'000'000;
constexpr double kLengthS = 90;

/// A vehicle that stops at 30 s and turns right at 60 s, when `eventful`.
double SpeedAt(double time_s, bool eventful) {
  return eventful ? 10 * std::min(1.0, std::abs(time_s - 30) / 5) : 10;
}
double TurnAt(double time_s, bool eventful) {
  return eventful ? 0.4 * std::exp(-std::pow((time_s - 60) / 1.5, 2)) : 0;
}

RecordedTrack Track(double interval_s, bool eventful) {
  RecordedTrack track;
  const geo::LocalFrame frame({48.25, 9.5});
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 0.4);
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  double course = 0, next = 0;
  for (double t = 0; t < kLengthS; t += 0.01) {
    course += TurnAt(t, eventful) * 0.01;
    place += SpeedAt(t, eventful) * 0.01 * Eigen::Vector2d(std::sin(course), std::cos(course));
    if (t < next) continue;
    next += interval_s;
    RecordedPosition position;
    position.stamp_ns = kBegin + Nanoseconds(t);
    const double east_m = noise(random), north_m = noise(random);  // In this order everywhere.
    position.position = frame.ToGeo(place + Eigen::Vector2d(east_m, north_m));
    track.positions.push_back(position);
  }
  return track;
}

/// What a recorder sees whose clock is `behind_s` behind.
std::vector<ImageMotion> Picture(double behind_s, bool eventful) {
  std::vector<ImageMotion> picture;
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 0.02);
  for (double t = 5; t < kLengthS - 5; t += 0.1) {
    picture.push_back({kBegin + Nanoseconds(t - behind_s),
                       0.9 * TurnAt(t, eventful) + noise(random),
                       0.03 * SpeedAt(t, eventful) + std::abs(noise(random))});
  }
  return picture;
}

TEST(ClockOffset, AStopAndATurnTellHowFarTheClocksAreApart) {
  for (const double behind_s : {-17.3, -0.4, 0.0, 6.25, 20.0}) {
    for (const double interval_s : {0.2, 1.0}) {
      const ClockOffsetAnswer answer =
          FindClockOffset(Picture(behind_s, true), Track(interval_s, true));
      ASSERT_TRUE(answer.offset) << behind_s << ": " << answer.reason;
      EXPECT_NEAR(answer.offset->seconds, behind_s, 0.15) << interval_s;
      EXPECT_LT(answer.offset->sigma_s, 0.15);
    }
  }
}

TEST(ClockOffset, NothingIsToldOfAVehicleThatNeitherStopsNorTurns) {
  const ClockOffsetAnswer answer = FindClockOffset(Picture(3, false), Track(1, false));
  EXPECT_FALSE(answer.offset);
  EXPECT_FALSE(answer.reason.empty());
}

TEST(ClockOffset, NothingIsToldOfAnotherTime) {
  const ClockOffsetAnswer answer = FindClockOffset(Picture(4000, true), Track(1, true));
  EXPECT_EQ(answer.reason, "the recording's times lie outside the track's");
}

}  // namespace
}  // namespace livemap::recordings
