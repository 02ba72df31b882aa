#include "localization/datum_election.h"

#include <gtest/gtest.h>

#include <limits>

#include "common/time.h"

namespace livemap::localization {
namespace {

const geo::GeoPoint kHere{48.1, 11.5};
const geo::GeoPoint kTokyo{35.7, 139.7};
const geo::GeoPoint kSydney{-33.9, 151.2};

std::optional<geo::GeoPoint> Vote(DatumElection& election, double time_s,
                                  const geo::GeoPoint& place) {
  return election.Add({1'700'000'000'000'000'000 + Nanoseconds(time_s), place, 1.0});
}

TEST(DatumElection, ThreeFixesThatAgreeChooseTheFirstOfThem) {
  DatumElection election{{}};
  const geo::GeoPoint first = kHere;
  EXPECT_FALSE(Vote(election, 0, first));
  EXPECT_FALSE(Vote(election, 1, geo::GeodesicDestination(kHere, 1, 20)));
  const auto datum = Vote(election, 2, geo::GeodesicDestination(kHere, 1, 40));
  ASSERT_TRUE(datum);
  EXPECT_EQ(datum->latitude_deg, first.latitude_deg);
}

TEST(DatumElection, WrongFirstFixesAreOutvoted) {
  for (int wrong = 1; wrong <= 2; ++wrong) {
    DatumElection election{{}};
    for (int i = 0; i < wrong; ++i) EXPECT_FALSE(Vote(election, 0.1 * i, kTokyo));
    std::optional<geo::GeoPoint> datum;
    for (int i = 0; i < 6 && !datum; ++i) datum = Vote(election, 1 + 0.1 * i, kHere);
    ASSERT_TRUE(datum);
    EXPECT_LT(geo::GeodesicDistanceM(*datum, kHere), 1);
  }
}

TEST(DatumElection, FixesThatAllContradictEachOtherChooseNothing) {
  DatumElection election{{}};
  EXPECT_FALSE(Vote(election, 0, kHere));
  EXPECT_FALSE(Vote(election, 1, kTokyo));
  EXPECT_FALSE(Vote(election, 2, kSydney));
  EXPECT_FALSE(Vote(election, 40, {10, 10}));
}

TEST(DatumElection, AfterAWhileTheLargestGroupIsEnough) {
  DatumElection election{{}};
  for (int i = 0; i < 10; ++i) Vote(election, i, {10.0 + i, 10});
  Vote(election, 29, kHere);
  const auto datum = Vote(election, 31, kHere);
  ASSERT_TRUE(datum);
  EXPECT_LT(geo::GeodesicDistanceM(*datum, kHere), 1);
}

TEST(DatumElection, OneFixRepeatedIsOneVote) {
  DatumElection election{{}};
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(Vote(election, 0, kHere));
}

TEST(DatumElection, AMemoryOfManyFixesIsBoundedAndStillRight) {
  DatumElection::Config config;
  config.min_span_s = 10;
  config.max_wait_s = std::numeric_limits<double>::infinity();
  DatumElection election{config};
  for (int i = 0; i < 200; ++i) EXPECT_FALSE(Vote(election, 0.01 * i, kTokyo));
  std::optional<geo::GeoPoint> datum;
  for (int i = 0; i < 200 && !datum; ++i) datum = Vote(election, 5 + 0.5 * i, kHere);
  ASSERT_TRUE(datum);
  EXPECT_LT(geo::GeodesicDistanceM(*datum, kHere), 1);
}

}  // namespace
}  // namespace livemap::localization
