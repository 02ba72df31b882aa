#include "zone/registry/vehicle_track.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "test/zone/test_times.h"

namespace livemap::zone {
namespace {

const geo::GeoPoint kTrackStart{40.44, -79.95};

/// North at 10 m/s from kTrackStart at second 100, a point every `every_s`.
std::vector<TrackPoint> DriveNorth(double seconds, double every_s, double course_rad = 0) {
  std::vector<TrackPoint> track;
  for (double t = 0; t <= seconds; t += every_s) {
    track.push_back({static_cast<std::int64_t>((100 + t) * 1e9),
                     geo::GeodesicDestination(kTrackStart, 0, 10 * t), course_rad, 10});
  }
  return track;
}

geo::GeoPoint Ahead(double distance_m, double aside_m = 0) {
  return geo::GeodesicDestination(geo::GeodesicDestination(kTrackStart, 0, distance_m),
                                  90 * geo::kRadiansPerDegree, aside_m);
}

TEST(CouldSee, WhatLiesAheadWithinRangeAtItsTime) {
  const auto track = DriveNorth(30, 1);
  EXPECT_TRUE(CouldSee(track, 110 * kSecond, Ahead(130)));
  EXPECT_TRUE(CouldSee(track, 110 * kSecond, Ahead(130, 12)));
}

TEST(CouldSee, NotWhatLiesBehindAsideOrTooFarAhead) {
  const auto track = DriveNorth(30, 1);
  EXPECT_FALSE(CouldSee(track, 120 * kSecond, Ahead(50)));
  EXPECT_FALSE(CouldSee(track, 115 * kSecond, Ahead(150, 120)));
  EXPECT_FALSE(CouldSee(track, 105 * kSecond, Ahead(290)));
}

TEST(CouldSee, NotBeforeOrAfterThePassage) {
  const auto track = DriveNorth(600, 1);
  EXPECT_TRUE(CouldSee(track, 130 * kSecond, Ahead(320)));
  EXPECT_FALSE(CouldSee(track, 170 * kSecond, Ahead(320)));
  EXPECT_FALSE(CouldSee(track, 100 * kSecond, Ahead(320)));
}

TEST(CouldSee, BetweenPointsSomeSecondsApartTheVehicleDroveStraight) {
  SightRule rule;
  rule.position_slack_m = 1;
  const auto track = DriveNorth(30, 15);
  EXPECT_TRUE(CouldSee(track, 107 * kSecond, Ahead(80, 20), rule));
}

TEST(CouldSee, NothingAcrossALongGapInTheTrack) {
  const auto track = DriveNorth(300, 60);
  EXPECT_FALSE(CouldSee(track, 130 * kSecond, Ahead(320)));
}

TEST(CouldSee, AVehicleThatDrivesTheOtherWayPassesToo) {
  auto track = DriveNorth(30, 1);
  for (std::size_t i = 0; i < track.size(); ++i) {
    track[i].position =
        geo::GeodesicDestination(kTrackStart, 0, 300 - 10.0 * static_cast<double>(i));
    track[i].course_rad = 180 * geo::kRadiansPerDegree;
  }
  EXPECT_TRUE(CouldSee(track, 115 * kSecond, Ahead(120)));
  EXPECT_FALSE(CouldSee(track, 125 * kSecond, Ahead(290)));
}

TEST(CouldSee, AStandingVehicleSeesAheadOfIt) {
  const std::vector<TrackPoint> track{{100 * kSecond, kTrackStart, 0, 0},
                                      {105 * kSecond, kTrackStart, 0, 0}};
  EXPECT_TRUE(CouldSee(track, 103 * kSecond, Ahead(40)));
  EXPECT_FALSE(CouldSee(track, 103 * kSecond, geo::GeodesicDestination(kTrackStart, 3.14, 40)));
}

TEST(CouldSee, NothingWithoutATrackAndNothingThatIsNoPlace) {
  EXPECT_FALSE(CouldSee({}, 100 * kSecond, kTrackStart));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(CouldSee(DriveNorth(30, 1), 110 * kSecond, {nan, 0}));
  EXPECT_FALSE(CouldSee({{100 * kSecond, {nan, nan}, 0, 1}}, 100 * kSecond, kTrackStart));
}

TEST(CouldSee, AWildTrackEndsInBoundedTime) {
  std::vector<TrackPoint> track;
  for (int i = 0; i < 100; ++i) {
    track.push_back({i * kSecond, {i % 2 == 0 ? 89.0 : -89.0, i * 1.5}, 1e300, -1e300});
  }
  EXPECT_FALSE(CouldSee(track, 50 * kSecond, {0.001, 179}));
}

TEST(VehicleTrackTest, TheCourseOfAPassIsThatOfTheNearestMomentInMotion) {
  const geo::LocalFrame frame({40.44, -79.94});
  const auto point = [&](double at_s, double north_m, double course_rad, double speed_mps) {
    return TrackPoint{static_cast<std::int64_t>(at_s * 1e9), frame.ToGeo({0, north_m}), course_rad,
                      speed_mps};
  };
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  const std::vector<TrackPoint> turning{point(0, 0, 0.1, 10), point(1, 10, 0.5, 10),
                                        point(2, 20, 0.9, 0.2)};
  EXPECT_EQ(CourseAt(turning, 200'000'000), 0.1);
  EXPECT_EQ(CourseAt(turning, 1'900'000'000), 0.5);
  EXPECT_TRUE(std::isnan(CourseAt(turning, 60'000'000'000)));
  EXPECT_TRUE(std::isnan(CourseAt({}, 0)));
  // Without a course, by the way driven; a vehicle that stands has none.
  EXPECT_NEAR(CourseAt({point(0, 0, unknown, 3), point(2, -6, unknown, 3)}, 1'000'000'000), M_PI,
              1e-6);
  EXPECT_TRUE(std::isnan(CourseAt({point(0, 0, unknown, 0), point(2, 0.5, unknown, 0)}, 0)));
}

}  // namespace
}  // namespace livemap::zone
