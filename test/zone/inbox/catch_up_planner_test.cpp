#include "zone/inbox/catch_up_planner.h"

#include <gtest/gtest.h>

#include <cmath>

namespace livemap::zone {
namespace {

constexpr geo::GeoPoint kSquare{40.44, -79.94};

geo::GeoPoint EastOfSquare(double distance_m) {
  return geo::GeodesicDestination(kSquare, M_PI / 2, distance_m);
}

class CatchUpTest : public ::testing::Test {
 protected:
  /// A position message, a second after the one before.
  std::optional<CatchUpOrder> Say(std::uint64_t map_sequence, double east_m = 0,
                                  const std::string& vehicle = "car-1") {
    now_ns_ += 1'000'000'000;
    return planner_.Update(vehicle, EastOfSquare(east_m), map_sequence, announced_, now_ns_);
  }
  /// How many further messages it takes until it is told; at most `limit`.
  int SecondsUntilTold(std::uint64_t map_sequence, int limit) {
    for (int i = 1; i <= limit; ++i) {
      if (Say(map_sequence)) return i;
    }
    return limit + 1;
  }

  CatchUpPlanner planner_{CatchUpPlanner::Config{}};
  std::int64_t now_ns_ = 1'700'000'000'000'000'000;
  std::uint64_t announced_ = 100;
};

TEST_F(CatchUpTest, ANewVehicleIsToldAllAroundItOnce) {
  const auto order = Say(0);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->vehicle_id, "car-1");
  EXPECT_EQ(order->since, 0u);
  EXPECT_LT(geo::GeodesicDistanceM(order->centre, kSquare), 0.01);
  EXPECT_FALSE(Say(0)) << "it is being told";
  planner_.Told("car-1", now_ns_);
  for (int i = 0; i < 30; ++i) EXPECT_FALSE(Say(100));
}

TEST_F(CatchUpTest, AVehicleThatMissedAnAnnouncementIsToldWhatItMissedAfterTheLag) {
  Say(100);
  planner_.Told("car-1", now_ns_);
  for (int i = 0; i < 10; ++i) Say(100);
  announced_ = 107;
  const int seconds = SecondsUntilTold(100, 20);
  EXPECT_GE(seconds, 4);
  EXPECT_LE(seconds, 6) << "the lag of 3 s, and a message before it is known what to await";
  planner_.Told("car-1", now_ns_);
  EXPECT_FALSE(Say(107));
}

TEST_F(CatchUpTest, ABusyZoneWhoseAnnouncementsAreOnTheirWayTellsNobody) {
  Say(100);
  planner_.Told("car-1", now_ns_);
  for (int i = 0; i < 60; ++i) {
    announced_ += 10;
    EXPECT_FALSE(Say(announced_ - 10)) << "always a second behind";
  }
}

TEST_F(CatchUpTest, WhatDidNotHelpIsToldAgainEverMoreRarely) {
  Say(100);
  planner_.Told("car-1", now_ns_);
  announced_ = 107;
  for (int i = 0; i < 6; ++i) Say(100);
  int previous = 0;
  for (int i = 0; i < 3; ++i) {
    planner_.Told("car-1", now_ns_);
    const int seconds = SecondsUntilTold(100, 100);
    EXPECT_GT(seconds, previous);
    previous = seconds;
  }
  EXPECT_LE(previous, 61);
}

TEST_F(CatchUpTest, AVehicleThatSaysItKnowsMoreThanWasAnnouncedIsToldEverMoreRarely) {
  ASSERT_TRUE(Say(5000));
  int previous = 0;
  for (int i = 0; i < 3; ++i) {
    planner_.Told("car-1", now_ns_);
    const int seconds = SecondsUntilTold(5000 + static_cast<std::uint64_t>(i), 100);
    EXPECT_GT(seconds, previous);
    previous = seconds;
  }
}

TEST_F(CatchUpTest, AVehicleThatForgetsAgainAndAgainIsToldEverMoreRarely) {
  ASSERT_TRUE(Say(0));
  int seconds = 0;
  for (int i = 0; i < 4; ++i) {
    planner_.Told("car-1", now_ns_);
    EXPECT_FALSE(Say(100));
    seconds = SecondsUntilTold(0, 100);
  }
  EXPECT_GT(seconds, 15);
}

TEST_F(CatchUpTest, AVehicleThatMovedFarIsToldAllAroundItsNewPlace) {
  Say(100);
  planner_.Told("car-1", now_ns_);
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(Say(100, 2000));
  const auto order = Say(100, 2600);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->since, 0u);
  EXPECT_EQ(order->known, 100u);
  EXPECT_LT(geo::GeodesicDistanceM(order->centre, EastOfSquare(2600)), 0.01);
}

TEST_F(CatchUpTest, WhatWasMissedIsToldAroundWhereAllWasTold) {
  Say(100);
  planner_.Told("car-1", now_ns_);
  announced_ = 105;
  std::optional<CatchUpOrder> order;
  for (int i = 0; i < 12 && !order; ++i) order = Say(100, 2000);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->since, 100u);
  EXPECT_LT(geo::GeodesicDistanceM(order->centre, kSquare), 0.01);
}

TEST_F(CatchUpTest, AVehicleOfAZoneOfBeforeIsToldAll) {
  const auto order = Say(5000);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->since, 0u);
  EXPECT_EQ(order->known, 5000u) << "more than was ever announced";
}

TEST_F(CatchUpTest, NothingIsToldWhereNothingWasEverAnnounced) {
  announced_ = 0;
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(Say(0));
  announced_ = 1;
  EXPECT_TRUE(Say(0)) << "it may have missed it";
}

TEST_F(CatchUpTest, AVehicleThatWasSilentForLongIsNew) {
  Say(100);
  planner_.Told("car-1", now_ns_);
  now_ns_ += 61'000'000'000;
  EXPECT_TRUE(Say(100));
}

TEST_F(CatchUpTest, ManyVehiclesAreBounded) {
  CatchUpPlanner::Config config;
  config.max_vehicles = 3;
  CatchUpPlanner planner(config);
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(planner.Update("car-" + std::to_string(i), kSquare, 0, 100, 1000 + i));
  }
  EXPECT_EQ(planner.vehicles(), 3u);
  planner.Told("car-0", 2000);
}

TEST_F(CatchUpTest, AVehicleThatAsksAboutCellsIsToldNothingElse) {
  planner_.NoteCellRequest("car-1", now_ns_);
  for (int i = 0; i < 200; ++i) EXPECT_FALSE(Say(0, 100.0 * i));
}

TEST_F(CatchUpTest, AVehicleThatNoLongerAsksAboutCellsIsToldAllAroundIt) {
  planner_.NoteCellRequest("car-1", now_ns_);
  EXPECT_EQ(SecondsUntilTold(0, 1000), 301);
}

TEST_F(CatchUpTest, AVehicleThatIsNewIsInvitedOnceToAskAboutCells) {
  EXPECT_FALSE(planner_.TakeInvitation("car-1"));
  Say(0);
  EXPECT_TRUE(planner_.TakeInvitation("car-1"));
  Say(0);
  EXPECT_FALSE(planner_.TakeInvitation("car-1"));
  planner_.NoteCellRequest("car-2", now_ns_);
  Say(0, 0, "car-2");
  EXPECT_FALSE(planner_.TakeInvitation("car-2"));
}

TEST_F(CatchUpTest, ANewVehicleHasAMomentToAskAboutCells) {
  CatchUpPlanner::Config config;
  config.cell_wait_s = 3;
  planner_ = CatchUpPlanner(config);
  EXPECT_EQ(SecondsUntilTold(0, 100), 4);
}

}  // namespace
}  // namespace livemap::zone
