#include "streets/street_lines.h"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

namespace livemap::streets {
namespace {

constexpr std::size_t kMany = 100'000;

/// A motorway northwards past a residential street, and a long trunk road 100 km to the east.
StreetMap DrawnTown() {
  StreetMapBuilder builder;
  Street street;
  street.id = 1;
  street.kind = StreetKind::kMotorway;
  builder.AddStreet(street, "M 1", {1, 2, 3});
  street.id = 2;
  street.kind = StreetKind::kResidential;
  builder.AddStreet(street, "Home St", {4, 5, 99, 6, 7});
  street.id = 3;
  street.kind = StreetKind::kTrunk;
  builder.AddStreet(street, "T 3", {8, 9});
  builder.SetPlace(1, {40.40, -80.00});
  builder.SetPlace(2, {40.45, -80.000001});
  builder.SetPlace(3, {40.50, -80.00});
  builder.SetPlace(4, {40.44, -79.99});
  builder.SetPlace(5, {40.44, -79.98});
  // Node 99 is missing: the street has a gap.
  builder.SetPlace(6, {40.44, -79.97});
  builder.SetPlace(7, {40.45, -79.97});
  builder.SetPlace(8, {40.40, -79.00});
  builder.SetPlace(9, {40.50, -79.00});
  return builder.Build();
}

std::multiset<std::string> Names(const StreetLines& lines, const StreetLines::Drawing& drawing) {
  std::multiset<std::string> names;
  for (const StreetLine& line : drawing.lines) {
    names.insert(lines.map().NameOf(lines.map().StreetOf(line.segment)));
  }
  return names;
}

class StreetLinesTest : public testing::Test {
 protected:
  const geo::GeoBox town_{{40.43, -80.01}, {40.46, -79.96}};
  StreetMap map_ = DrawnTown();
  StreetLines lines_{map_};
};

TEST_F(StreetLinesTest, FindsWhatTouchesTheBoxOfTheKindsOfTheZoom) {
  using NameSet = std::multiset<std::string>;
  EXPECT_EQ(Names(lines_, lines_.Find(town_, 13, kMany)), (NameSet{"Home St", "Home St", "M 1"}));
  EXPECT_EQ(Names(lines_, lines_.Find(town_, 12, kMany)), (NameSet{"M 1"}));
  const geo::GeoBox country{{30, -90}, {50, -70}};
  EXPECT_EQ(Names(lines_, lines_.Find(country, 5, kMany)), (NameSet{"M 1", "T 3"}));
  EXPECT_TRUE(lines_.Find({{10, 10}, {11, 11}}, 15, kMany).lines.empty());
}

TEST_F(StreetLinesTest, LeavesOutPointsThatNobodySees) {
  ASSERT_EQ(lines_.Find(town_, 12, kMany).lines.at(0).points.size(), 2U);
  EXPECT_EQ(lines_.Find(town_, 21, kMany).lines.at(0).points.size(), 3U);
}

TEST_F(StreetLinesTest, WhatIsTooMuchEndsWithTheLessImportant) {
  const StreetLines::Drawing cut = lines_.Find(town_, 13, 4);
  EXPECT_TRUE(cut.is_truncated);
  EXPECT_EQ(Names(lines_, cut), (std::multiset<std::string>{"Home St", "M 1"}));
  EXPECT_FALSE(lines_.Find(town_, 13, 6).is_truncated);
}

/// Of ways between nodes 1, 2, ... along a parallel, 0.01 degrees apart.
StreetMap DrawnWays(const std::vector<std::vector<std::int64_t>>& ways, bool one_way) {
  StreetMapBuilder builder;
  Street street;
  street.kind = StreetKind::kPrimary;
  street.backward = !one_way;
  for (const std::vector<std::int64_t>& nodes : ways) builder.AddStreet(street, "Main", nodes);
  for (int node = 1; node <= 9; ++node) builder.SetPlace(node, {40.44, -80 + 0.01 * node});
  return builder.Build();
}

std::size_t LinesFromAfar(const std::vector<std::vector<std::int64_t>>& ways, bool one_way) {
  const StreetMap map = DrawnWays(ways, one_way);
  return StreetLines(map).Find(map.Bounds(), 9, kMany).lines.size();
}

TEST_F(StreetLinesTest, FromAfarWaysThatGoOnInEachOtherAreOneLine) {
  // In any order and direction.
  const StreetMap map = DrawnWays({{1, 2}, {3, 2}, {3, 4, 5}, {6, 5}}, false);
  const StreetLines lines(map);
  const auto drawn = lines.Find(map.Bounds(), 9, kMany).lines;
  ASSERT_EQ(drawn.size(), 1U);
  ASSERT_EQ(drawn[0].points.size(), 2U);
  EXPECT_NEAR(drawn[0].points.front().longitude_deg, -79.99, 1e-9);
  EXPECT_NEAR(drawn[0].points.back().longitude_deg, -79.94, 1e-9);
  EXPECT_EQ(lines.Find(map.Bounds(), 14, kMany).lines.size(), 4U);
}

TEST_F(StreetLinesTest, LinesAreNotJoinedWhereThreeMeetOrAgainstAOneWayStreet) {
  EXPECT_EQ(LinesFromAfar({{1, 2}, {2, 3}}, true), 1U);
  EXPECT_EQ(LinesFromAfar({{1, 2}, {3, 2}}, true), 2U);
  EXPECT_EQ(LinesFromAfar({{1, 2}, {2, 3}, {2, 9}}, false), 3U);
  // A ring is a line, too, and one way that is a ring is not joined to itself.
  EXPECT_EQ(LinesFromAfar({{1, 2}, {2, 3}, {3, 1}}, false), 1U);
  EXPECT_EQ(LinesFromAfar({{1, 2, 3, 1}}, false), 1U);
}

TEST_F(StreetLinesTest, BoundsHoldAllSegments) {
  const geo::GeoBox bounds = map_.Bounds();
  EXPECT_DOUBLE_EQ(bounds.south_west.latitude_deg, 40.40);
  EXPECT_DOUBLE_EQ(bounds.south_west.longitude_deg, -80.000001);
  EXPECT_DOUBLE_EQ(bounds.north_east.latitude_deg, 40.50);
  EXPECT_DOUBLE_EQ(bounds.north_east.longitude_deg, -79.00);
}

}  // namespace
}  // namespace livemap::streets
