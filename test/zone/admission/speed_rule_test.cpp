#include "zone/admission/speed_rule.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "test/zone/test_times.h"

namespace livemap::zone {
namespace {

const std::vector<geo::GeoPoint> kCities{
    {40.44, -79.99},  {47.50, 19.04}, {-33.87, 151.21}, {35.68, 139.69}, {51.51, -0.13},
    {-22.91, -43.17}, {55.75, 37.62}, {30.04, 31.24},   {19.43, -99.13}, {1.35, 103.82}};

ReportedFix Fix(std::int64_t stamp_ns, const geo::GeoPoint& position) {
  return {stamp_ns, position, 2};
}

/// How many of them are accepted, in this order.
int Accepted(const std::vector<ReportedFix>& fixes, const SpeedRule& rule = {}) {
  ReportTrack track;
  int accepted = 0;
  for (const ReportedFix& fix : fixes) accepted += Challenge(track, fix, rule) ? 0 : 1;
  return accepted;
}

TEST(SpeedRule, NoOrderOfStampsPutsOneVehicleIntoTenCities) {
  // Four reports a city, each some minutes before or after another city's.
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::vector<ReportedFix> fixes;
    for (int i = 0; i < 40; ++i) {
      fixes.push_back(Fix(kStart - (i * 7 % 40) * 600 * kSecond,
                          kCities[static_cast<std::size_t>(i) % kCities.size()]));
    }
    if (seed > 0) std::shuffle(fixes.begin(), fixes.end(), random);
    // Those of one city, and of another one that can be reached within the seven hours.
    EXPECT_LE(Accepted(fixes), 8) << seed;
  }
}

TEST(SpeedRule, StampsFarFromTheLastReportDoNotHideAPlaceInBetween) {
  ReportTrack track;
  const SpeedRule rule;
  EXPECT_FALSE(Challenge(track, Fix(kStart - 3 * kDay, kCities[0]), rule));
  EXPECT_FALSE(Challenge(track, Fix(kStart, kCities[0]), rule));
  // A day from the last report, and possible from it; not from the one at the same time.
  EXPECT_FALSE(Challenge(track, Fix(kStart - kDay, kCities[0]), rule));
  EXPECT_TRUE(Challenge(track, Fix(kStart - kDay + 60 * kSecond, kCities[4]), rule));
  EXPECT_TRUE(Challenge(track, Fix(kStart - 3 * kDay - kSecond, kCities[2]), rule));
}

TEST(SpeedRule, AnOutboxOfAWholeDrivePassesInAnyOrder) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    std::mt19937 random(seed);
    std::vector<ReportedFix> drive;
    for (int i = 0; i < 3000; ++i) {
      drive.push_back(Fix(kStart - 20 * kDay + i * kSecond,
                          geo::GeodesicDestination({40.44, -79.94}, 1, 30.0 * i)));
    }
    std::shuffle(drive.begin(), drive.end(), random);
    EXPECT_EQ(Accepted(drive), 3000) << seed;
  }
}

TEST(SpeedRule, WhatIsRememberedIsBoundedAndSpansAllThatWasToldAndStillContradicts) {
  ReportTrack track;
  const SpeedRule rule;
  const auto place = [](int i) { return geo::GeodesicDestination({40.44, -79.94}, 1, 20.0 * i); };
  for (int i = 0; i < 100'000; ++i) {
    EXPECT_FALSE(Challenge(track, Fix(kStart + i * 10 * kSecond, place(i)), rule));
  }
  EXPECT_LE(track.places.size(), ReportTrack::kMaxPlaces);
  EXPECT_EQ(track.places.front().fix.stamp_ns, kStart);
  EXPECT_EQ(track.places.back().fix.stamp_ns, kStart + 999'990 * kSecond);
  // Days ago on this drive it was not on the other side of the earth.
  for (int i = 0; i < 100'000; i += 9973) {
    EXPECT_TRUE(Challenge(track, Fix(kStart + (10 * i + 5) * kSecond, kCities[2]), rule)) << i;
  }
}

TEST(SpeedRule, ManyAcceptedPlacesAreOutvotedByNoFew) {
  ReportTrack track;
  const SpeedRule rule;
  for (int i = 0; i < 10; ++i) {
    EXPECT_FALSE(Challenge(track, Fix(kStart + i * kSecond, kCities[0]), rule));
  }
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(Challenge(track, Fix(kStart + (10 + i) * kSecond, kCities[1]), rule)) << i;
  }
  // One more than those that contradict: a clock or a receiver may have been wrong for a while.
  EXPECT_FALSE(Challenge(track, Fix(kStart + 20 * kSecond, kCities[1]), rule));
  EXPECT_TRUE(Challenge(track, Fix(kStart + 21 * kSecond, kCities[0]), rule));
}

TEST(SpeedRule, AWrongFirstPlaceIsForgottenAfterThreeThatAgree) {
  ReportTrack track;
  const SpeedRule rule;
  EXPECT_FALSE(Challenge(track, Fix(kStart, {1e-6, 0}), rule));
  int refused = 0;
  for (int i = 1; i <= 20; ++i) {
    refused += Challenge(track, Fix(kStart + i * kSecond, kCities[0]), rule) ? 1 : 0;
  }
  EXPECT_EQ(refused, 2);
}

TEST(SpeedRule, WhatIsForgottenLeavesTheNewestPlaceAndTheNewestThatIsKept) {
  ReportTrack track;
  for (int i = 0; i < 4; ++i) {
    EXPECT_FALSE(Challenge(track, Fix(kStart + i * kHour, kCities[0]), SpeedRule(), i < 2));
  }
  track.unsaved.clear();  // They were saved.
  ForgetBefore(track, kStart);
  EXPECT_EQ(track.places.size(), 4U);
  ForgetBefore(track, kStart + kDay);
  ASSERT_EQ(track.places.size(), 2U);
  EXPECT_EQ(track.places[0].fix.stamp_ns, kStart + kHour);
  EXPECT_EQ(track.places[1].fix.stamp_ns, kStart + 3 * kHour);
  EXPECT_EQ(track.unsaved.at(kStart), UnsavedPlace::kDropped);
}

TEST(SpeedRule, HoldsAcrossTheAntimeridianAndAtThePoles) {
  const SpeedRule rule;
  EXPECT_EQ(ImpliedSpeed(Fix(kStart, {10, 179.9999}), Fix(kStart, {10, -179.9999}), rule), 0);
  EXPECT_EQ(ImpliedSpeed(Fix(kStart, {89.9999, 0}), Fix(kStart, {89.9999, 180}), rule), 0);
  EXPECT_EQ(ImpliedSpeed(Fix(kStart, {-90, 0}), Fix(kStart, {-90, 77}), rule), 0);
  EXPECT_GT(ImpliedSpeed(Fix(kStart, {10, 179}), Fix(kStart + kSecond, {10, -179}), rule), 1e5);
}

}  // namespace
}  // namespace livemap::zone
