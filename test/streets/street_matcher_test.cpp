#include "streets/street_matcher.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/error.h"

namespace livemap::streets {
namespace {

/// A main street northwards with a parallel one 20 m to the east, a cross street at 300 m, and a
/// bridge above the main street at 150 m.
std::shared_ptr<const StreetMap> MatchedTown(const geo::LocalFrame& frame) {
  StreetMapBuilder builder;
  Street main;
  main.id = 1;
  builder.AddStreet(main, "Main", {1, 2, 3});
  Street parallel;
  parallel.id = 2;
  builder.AddStreet(parallel, "Side", {4, 5});
  Street cross;
  cross.id = 3;
  builder.AddStreet(cross, "Cross", {2, 6});
  Street bridge;
  bridge.id = 4;
  bridge.layer = 1;
  bridge.bridge = true;
  builder.AddStreet(bridge, "Bridge", {7, 8});
  const auto put = [&](int id, double east_m, double north_m) {
    builder.SetPlace(id, frame.ToGeo({east_m, north_m}));
  };
  put(1, 0, 0);
  put(2, 0, 300);
  put(3, 0, 600);
  put(4, 20, 0);
  put(5, 20, 280);
  put(6, -300, 300);
  put(7, -100, 150);
  put(8, 100, 150);
  return std::make_shared<const StreetMap>(builder.Build());
}

class StreetMatcherTest : public testing::Test {
 protected:
  StreetMatcherTest() : map_(MatchedTown(frame_)), matcher_(map_, StreetMatcher::Config()) {}

  void Drive(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m) {
    const Eigen::Vector2d way = to_m - from_m;
    const double course_rad = std::atan2(way.x(), way.y());
    for (double driven_m = 0; driven_m < way.norm(); driven_m += 3) {
      StreetMatcher::Position position;
      position.place = frame_.ToGeo(from_m + driven_m * way.normalized());
      position.sigma_m = 1.5;
      position.course_rad = course_rad;
      position.course_sigma_rad = 0.05;
      position.speed_mps = 14;
      ASSERT_TRUE(matcher_.Add(position));
    }
  }

  std::int64_t Way() const {
    return matcher_.matches().empty()
               ? 0
               : map_->StreetOf(matcher_.matches().front().travel.segment).id;
  }

  geo::LocalFrame frame_{{49.2, 7.0}};
  std::shared_ptr<const StreetMap> map_;
  StreetMatcher matcher_;
};

TEST_F(StreetMatcherTest, KnowsTheStreetDirectionAndPlaceAlongIt) {
  Drive({2, 10}, {2, 120});
  ASSERT_EQ(Way(), 1);
  const StreetMatch& match = matcher_.matches().front();
  EXPECT_TRUE(match.travel.forward);
  EXPECT_GT(match.probability, 0.95);
  EXPECT_NEAR(match.along_m, 118, 4);
  EXPECT_NEAR(match.left_m, -2, 0.2);
}

TEST_F(StreetMatcherTest, KnowsTheOppositeDirection) {
  Drive({-2, 250}, {-2, 150});
  ASSERT_EQ(Way(), 1);
  EXPECT_FALSE(matcher_.matches().front().travel.forward);
  EXPECT_NEAR(matcher_.matches().front().along_m, 150, 5);
}

TEST_F(StreetMatcherTest, IsNotTakenInByABridge) {
  Drive({1, 100}, {1, 152});
  EXPECT_EQ(Way(), 1);
  EXPECT_GT(matcher_.matches().front().probability, 0.9);
}

TEST_F(StreetMatcherTest, TellsAParallelStreet) {
  Drive({18, 10}, {18, 200});
  EXPECT_EQ(Way(), 2);
  EXPECT_GT(matcher_.matches().front().probability, 0.9);
}

TEST_F(StreetMatcherTest, FollowsATurn) {
  Drive({1, 200}, {1, 298});
  Drive({-1, 299}, {-60, 299});
  EXPECT_EQ(Way(), 3);
  EXPECT_GT(matcher_.matches().front().probability, 0.9);
}

TEST_F(StreetMatcherTest, KnowsThatItIsOnNoStreet) {
  Drive({0, 400}, {0, 500});
  EXPECT_GT(matcher_.on_street(), 0.9);
  Drive({0, 500}, {70, 600});
  EXPECT_LT(matcher_.on_street(), 0.1);
  Drive({300, 900}, {300, 1000});
  EXPECT_EQ(matcher_.on_street(), 0);
}

TEST_F(StreetMatcherTest, StandingChangesNothing) {
  Drive({1, 100}, {1, 200});
  const double before = matcher_.matches().front().probability;
  for (int i = 0; i < 1000; ++i) Drive({1, 199}, {1, 199.5});
  EXPECT_NEAR(matcher_.matches().front().probability, before, 0.05);
}

TEST_F(StreetMatcherTest, RefusesPositionsThatCannotBe) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  StreetMatcher::Position position;
  position.place = {nan, 7};
  EXPECT_FALSE(matcher_.Add(position));
  position.place = {49.2, 7};
  position.sigma_m = nan;
  EXPECT_FALSE(matcher_.Add(position));
  position.sigma_m = -1;
  EXPECT_FALSE(matcher_.Add(position));
  position.sigma_m = 1;
  position.course_rad = nan;
  EXPECT_FALSE(matcher_.Add(position));
  StreetMatcher::Config config;
  config.detour_m = 0;
  EXPECT_THROW(StreetMatcher(map_, config), Error);
}

TEST_F(StreetMatcherTest, TheSamePositionsGiveTheSameMatches) {
  Drive({1, 200}, {1, 330});
  const std::vector<StreetMatch> first = matcher_.matches();
  matcher_.Reset();
  Drive({1, 200}, {1, 330});
  ASSERT_EQ(first.size(), matcher_.matches().size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].probability, matcher_.matches()[i].probability);
  }
}

}  // namespace
}  // namespace livemap::streets
