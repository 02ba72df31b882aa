#include "streets/street_map.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/error.h"

namespace livemap::streets {
namespace {

const geo::GeoPoint kTown{49.2, 7.0};

/// Places by metres east and north of the town.
class StreetMapTest : public testing::Test {
 protected:
  void Way(std::int64_t id, const std::vector<std::int64_t>& nodes, Street street = {},
           const std::string& name = "") {
    street.id = id;
    builder_.AddStreet(street, name, nodes);
  }

  void Node(std::int64_t id, double east_m, double north_m) {
    builder_.SetPlace(id, frame_.ToGeo({east_m, north_m}));
  }

  static std::vector<std::int64_t> WaysOf(const StreetMap& map,
                                          const std::vector<Travel>& travels) {
    std::vector<std::int64_t> ways;
    for (const Travel& travel : travels) ways.push_back(map.StreetOf(travel.segment).id);
    std::sort(ways.begin(), ways.end());
    return ways;
  }

  geo::LocalFrame frame_{kTown};
  StreetMapBuilder builder_;
};

Street OneWay() {
  Street street;
  street.backward = false;
  return street;
}

TEST_F(StreetMapTest, FindsTheSegmentsNearAPlaceAndNoneFarAway) {
  Way(1, {1, 2, 3}, {}, "High Street");
  Way(2, {4, 5});
  Node(1, 0, 0);
  Node(2, 0, 100);
  Node(3, 0, 200);
  Node(4, 3000, 0);
  Node(5, 3000, 100);
  const StreetMap map = builder_.Build();
  EXPECT_EQ(map.streets(), 2U);
  EXPECT_EQ(map.segments(), 3U);
  EXPECT_EQ(map.SegmentsNear(frame_.ToGeo({10, 100}), 30).size(), 2U);
  EXPECT_EQ(map.SegmentsNear(frame_.ToGeo({3010, 50}), 30).size(), 1U);
  EXPECT_TRUE(map.SegmentsNear(frame_.ToGeo({1500, 50}), 30).empty());
  EXPECT_TRUE(map.SegmentsNear({91, 7}, 30).empty());
  EXPECT_TRUE(map.SegmentsNear(kTown, -1).empty());
  EXPECT_EQ(map.NameOf(map.StreetOf(0)), "High Street");
  EXPECT_EQ(map.NameOf(map.StreetOf(2)), "");
  EXPECT_LT(map.bytes(), 2000U);
}

TEST_F(StreetMapTest, FindsALongSegmentInEveryCellItCrosses) {
  Way(1, {1, 2});
  Node(1, 0, 0);
  Node(2, 8000, 5000);
  const StreetMap map = builder_.Build();
  for (double share = 0; share <= 1; share += 0.01) {
    EXPECT_EQ(map.SegmentsNear(frame_.ToGeo({8000 * share, 5000 * share}), 5).size(), 1U) << share;
  }
}

TEST_F(StreetMapTest, OneWayStreetsAreLeftInTheirDirectionOnly) {
  Way(1, {1, 2});
  Way(2, {2, 3}, OneWay());
  Way(3, {4, 2}, OneWay());
  Node(1, 0, 0);
  Node(2, 0, 100);
  Node(3, 100, 100);
  Node(4, -100, 100);
  const StreetMap map = builder_.Build();
  EXPECT_EQ(WaysOf(map, map.Continuations({0, true})), std::vector<std::int64_t>{2});
  EXPECT_FALSE(map.IsLegal({1, false}));
  EXPECT_TRUE(map.IsLegal({0, false}));
}

TEST_F(StreetMapTest, TurningBackIsForDeadEnds) {
  Way(1, {1, 2});
  Node(1, 0, 0);
  Node(2, 0, 100);
  const StreetMap map = builder_.Build();
  const std::vector<Travel> onwards = map.Continuations({0, true});
  ASSERT_EQ(onwards.size(), 1U);
  EXPECT_EQ(onwards[0], (Travel{0, false}));
}

TEST_F(StreetMapTest, ABridgeMeetsNothingBelow) {
  Way(1, {1, 2});
  Way(2, {3, 4});
  Node(1, 0, -100);
  Node(2, 0, 100);
  Node(3, -100, 0);
  Node(4, 100, 0);
  const StreetMap map = builder_.Build();
  EXPECT_EQ(WaysOf(map, map.Continuations({0, true})), std::vector<std::int64_t>{1});
}

TEST_F(StreetMapTest, StreetsAreCutWhereANodeIsMissing) {
  Way(1, {1, 2, 3, 4, 5});
  Node(1, 0, 0);
  Node(2, 0, 50);
  Node(4, 0, 150);
  Node(5, 0, 200);
  const StreetMap map = builder_.Build();
  EXPECT_EQ(map.segments(), 2U);
  EXPECT_EQ(map.counters().missing_nodes, 1U);
}

TEST_F(StreetMapTest, SegmentsThatCannotBeAreLeftOut) {
  Way(1, {1, 2});
  Way(2, {3, 4});
  Way(3, {5, 5, 6});
  Node(1, 0, 0);
  Node(2, 0, 30000);
  builder_.SetPlace(3, {10, 179.9999});
  builder_.SetPlace(4, {10, -179.9999});
  Node(5, 0, 0);
  Node(6, 0, 10);
  builder_.SetPlace(6, {1, 1});  // The first place counts.
  const StreetMap map = builder_.Build();
  EXPECT_EQ(map.segments(), 1U);
  EXPECT_EQ(map.counters().long_segments, 2U);
}

TEST_F(StreetMapTest, WidthsFollowTheTagsOrTwoLanes) {
  Street street;
  EXPECT_DOUBLE_EQ(street.HalfWidthM(), 3.5);
  street.lanes = 3;
  EXPECT_DOUBLE_EQ(street.HalfWidthM(), 5.25);
  street.width_m = 6;
  EXPECT_DOUBLE_EQ(street.HalfWidthM(), 3);
  Street ramp = OneWay();
  ramp.link = true;
  EXPECT_DOUBLE_EQ(ramp.HalfWidthM(), 1.75);
}

TEST(StreetMapLimitsTest, MoreThanTheLimitsIsRefusedByASentence) {
  StreetLimits limits;
  limits.max_streets = 1;
  limits.max_nodes = 4;
  limits.max_segments = 2;
  StreetMapBuilder builder(limits);
  EXPECT_THROW(builder.AddStreet({}, "", {1, 2, 3, 4, 5}), Error);
  builder.AddStreet({}, "", {1, 2, 3, 4});
  try {
    builder.AddStreet({}, "", {});
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "there are more than 1 streets, accepted are at most so many");
  }
  for (int i = 1; i <= 4; ++i) builder.SetPlace(i, {49, 7 + 0.0001 * i});
  EXPECT_THROW(builder.Build(), Error);
}

TEST(StreetMapLimitsTest, ANodeOfManyStreetsHasAtMost64WaysOn) {
  StreetMapBuilder builder;
  for (int i = 1; i <= 500; ++i) builder.AddStreet({}, "", {0, i});
  builder.SetPlace(0, {49, 7});
  for (int i = 1; i <= 500; ++i) builder.SetPlace(i, {49.0001, 7 + 0.00001 * i});
  const StreetMap map = builder.Build();
  EXPECT_LE(map.Continuations({499, false}).size(), 64U);
}

}  // namespace
}  // namespace livemap::streets
