#include "streets/ways_ahead.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numeric>

#include "streets/turn_choice.h"

namespace livemap::streets {
namespace {

/// A street northwards with a junction at 100 m: straight on, left, right.
StreetMap CrossTown(const geo::LocalFrame& frame, bool right_is_legal) {
  StreetMapBuilder builder;
  Street street;
  builder.AddStreet(street, "", {1, 2});
  builder.AddStreet(street, "", {2, 3});
  builder.AddStreet(street, "", {2, 4});
  Street right;
  right.forward = right_is_legal;
  builder.AddStreet(right, "", {2, 5});
  builder.SetPlace(1, frame.ToGeo({0, 0}));
  builder.SetPlace(2, frame.ToGeo({0, 100}));
  builder.SetPlace(3, frame.ToGeo({0, 300}));
  builder.SetPlace(4, frame.ToGeo({-200, 100}));
  builder.SetPlace(5, frame.ToGeo({200, 100}));
  return builder.Build();
}

class WaysAheadTest : public testing::Test {
 protected:
  /// Probabilities of straight on, left and right, from `along_m` on the street.
  std::vector<double> Shares(double along_m, const Driving& driving, double way_m = 200) {
    const WaysAhead ways(config_, map_, {{{0, true}, along_m, 0, 1}}, frame_, driving, way_m);
    std::vector<double> shares(3);
    for (const Leg& leg : ways.legs()) {
      if (leg.travel.segment > 0) shares[leg.travel.segment - 1] = leg.probability;
    }
    return shares;
  }

  geo::LocalFrame frame_{{49.2, 7.0}};
  StreetMap map_ = CrossTown(frame_, true);
  WaysAhead::Config config_;
};

Driving Steady(double speed_mps) {
  Driving driving;
  driving.speed_mps = speed_mps;
  driving.usual_mps = speed_mps;
  driving.course_known = true;
  return driving;
}

TEST_F(WaysAheadTest, EndsWhereTheWayEnds) {
  EXPECT_EQ(Shares(10, Steady(14), 50), (std::vector<double>{0, 0, 0}));
}

TEST_F(WaysAheadTest, FarFromAJunctionAllWaysArePossible) {
  const std::vector<double> shares = Shares(10, Steady(14));
  EXPECT_GT(shares[0], shares[1]);
  EXPECT_NEAR(shares[1], shares[2], 0.02);
  EXPECT_GT(shares[2], 0.1);
  EXPECT_LE(shares[0] + shares[1] + shares[2], 1);
}

TEST_F(WaysAheadTest, WhoDoesNotBrakeGoesStraightOn) { EXPECT_GT(Shares(70, Steady(14))[0], 0.9); }

TEST_F(WaysAheadTest, AHabitOfPassingCrossingsMakesStraightOnLikelier) {
  Driving driving = Steady(14);
  const double of_all = Shares(10, driving)[0];
  driving.turn_habit = 0.2;
  EXPECT_GT(Shares(10, driving)[0], of_all + 0.1);
  driving.turn_habit = 3;
  EXPECT_LT(Shares(10, driving)[0], of_all - 0.1);
}

TEST_F(WaysAheadTest, WhoBrakesInTimeTurns) {
  Driving driving = Steady(9);
  driving.usual_mps = 14;
  driving.push_mps2 = -2;
  EXPECT_LT(Shares(75, driving)[0], 0.35);
}

TEST_F(WaysAheadTest, ACourseThatBendsTellsTheSide) {
  Driving driving = Steady(5);
  driving.usual_mps = 14;
  driving.course_rad = -0.5;
  const std::vector<double> shares = Shares(92, driving);
  EXPECT_GT(shares[1], 0.8);
  EXPECT_LT(shares[2], 0.1);
}

TEST_F(WaysAheadTest, WhoIsMatchedBehindTheJunctionAndHasTurnedIsNotTakenToGoStraightOn) {
  Driving driving = Steady(5);
  driving.usual_mps = 14;
  driving.course_rad = -0.7;
  driving.approach = Travel{0, true};
  const std::vector<StreetMatch> matches{{{1, true}, 3, 0, 0.6}, {{0, true}, 97, 0, 0.4}};
  const WaysAhead ways(config_, map_, matches, frame_, driving, 100);
  ASSERT_EQ(ways.legs().size(), 4U);
  EXPECT_NEAR(ways.legs()[0].start_m, -100.6, 0.1) << "0.6 m behind the node, in the mean";
  for (const Leg& leg : ways.legs()) {
    if (leg.travel.segment == 2) {
      EXPECT_GT(leg.probability, 0.8);
    } else if (leg.travel.segment == 1) {
      EXPECT_LT(leg.probability, 0.1);
    }
  }
}

TEST_F(WaysAheadTest, WhoHasTurnedAndSpeedsUpIsNotTakenToGoStraightOn) {
  Driving driving = Steady(7);
  driving.usual_mps = 14;
  driving.push_mps2 = 1.8;
  driving.course_rad = -1.57;
  driving.approach = Travel{0, true};
  const std::vector<StreetMatch> matches{{{2, true}, 14, 0, 1}};
  const WaysAhead ways(config_, map_, matches, frame_, driving, 100);
  double left = 0;
  for (const Leg& leg : ways.legs()) {
    if (leg.travel.segment == 2) left = leg.probability;
  }
  EXPECT_GT(left, 0.9);
}

TEST_F(WaysAheadTest, WhoBrakesToATurnsSpeedRightBeforeTheJunctionTurns) {
  Driving driving = Steady(6.5);
  driving.usual_mps = 14;
  driving.push_mps2 = -2;
  EXPECT_LT(Shares(88, driving)[0], 0.5);
}

TEST_F(WaysAheadTest, OneWayStreetsAreNoChoice) {
  map_ = CrossTown(frame_, false);
  EXPECT_EQ(Shares(10, Steady(14))[2], 0);
}

TEST_F(WaysAheadTest, LegsStandBehindThoseFromWhichTheyComeAndSharesAddUp) {
  const WaysAhead ways(config_, map_, {{{0, true}, 10, 0, 0.9}}, frame_, Steady(14), 400);
  double ends = 0;
  for (std::size_t i = 0; i < ways.legs().size(); ++i) {
    EXPECT_LT(ways.legs()[i].before, static_cast<int>(i));
    ends += ways.legs()[i].ends;
  }
  EXPECT_NEAR(ends, 0.9, 1e-9);
  EXPECT_DOUBLE_EQ(ways.legs()[0].start_m, -10);
}

TEST_F(WaysAheadTest, ManyWaysAreBounded) {
  config_.max_legs = 3;
  const WaysAhead ways(config_, map_, {{{0, true}, 10, 0, 1}}, frame_, Steady(14), 400);
  EXPECT_EQ(ways.legs().size(), 3U);
}

TEST(TurnChoiceTest, ExitsOfARoundaboutAreEquallyLikelyAndTheLastOneIsTaken) {
  TurnOption exit{0.9};
  TurnOption ring{-0.3};
  ring.ring = true;
  Approach approach;
  approach.in_roundabout = true;
  approach.exits_left = 3;
  const std::vector<double> first = TurnProbabilities({}, approach, {exit, ring});
  EXPECT_NEAR(first[1] / first[0], 2, 1e-9);
  approach.exits_left = 1;
  EXPECT_GT(TurnProbabilities({}, approach, {exit, ring})[0], 0.85);
}

TEST(TurnChoiceTest, ProbabilitiesLeaveRoomForAWayThatTheMapDoesNotHave) {
  const std::vector<double> shares = TurnProbabilities({}, {}, {{0.1}, {1.5}});
  const double sum = std::accumulate(shares.begin(), shares.end(), 0.0);
  EXPECT_LT(sum, 1);
  EXPECT_GT(sum, 0.9);
  EXPECT_TRUE(TurnProbabilities({}, {}, {}).empty());
}

}  // namespace
}  // namespace livemap::streets
