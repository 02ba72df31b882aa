#include "geo/map_cell.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <set>

namespace livemap::geo {
namespace {

TEST(MapCellTest, IsTheTileOfTheWebMercatorGridAtZoom15) {
  // The Brandenburg Gate's tile 15/17601/10746, as slippy maps number them.
  const MapCell cell = MapCell::At({52.5163, 13.3777});
  EXPECT_EQ(cell.Quadkey(), "120210233222021");
  EXPECT_EQ(MapCell::FromQuadkey("120210233222021"), cell);
}

TEST(MapCellTest, NumberAndQuadkeyLeadBackToTheCell) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> latitude(-90, 90);
  std::uniform_real_distribution<double> longitude(-180, 180);
  for (int i = 0; i < 10000; ++i) {
    const GeoPoint point{latitude(random), longitude(random)};
    const MapCell cell = MapCell::At(point);
    EXPECT_EQ(MapCell::FromNumber(cell.number()), cell);
    EXPECT_EQ(MapCell::FromQuadkey(cell.Quadkey()), cell);
    EXPECT_EQ(MapCell::At(cell.Middle()), cell);
    EXPECT_EQ(cell.DistanceM(point), 0);
  }
}

TEST(MapCellTest, WhatIsNoCellIsRefused) {
  EXPECT_FALSE(MapCell::FromNumber(1U << 30));
  EXPECT_FALSE(MapCell::FromNumber(UINT32_MAX));
  EXPECT_FALSE(MapCell::FromQuadkey(""));
  EXPECT_FALSE(MapCell::FromQuadkey("12021023322202"));
  EXPECT_FALSE(MapCell::FromQuadkey("1202102332220213"));
  EXPECT_FALSE(MapCell::FromQuadkey("120210233222024"));
  EXPECT_FALSE(MapCell::FromQuadkey("12021023322202+"));
}

TEST(MapCellTest, TheAntimeridianBelongsToItsEast) {
  EXPECT_EQ(MapCell::At({-17, 180}), MapCell::At({-17, -180}));
  EXPECT_NE(MapCell::At({-17, 179.9999}), MapCell::At({-17, -180}));
}

TEST(MapCellTest, TheOutermostRowsReachToThePoles) {
  EXPECT_EQ(MapCell::At({90, 10}), MapCell::At({85.06, 10}));
  EXPECT_EQ(MapCell::At({-90, 10}), MapCell::At({-85.06, 10}));
  EXPECT_NE(MapCell::At({85.04, 10}), MapCell::At({85.06, 10}));
}

TEST(MapCellTest, CellsWithinARadiusAreThoseOfThePointsInIt) {
  std::mt19937 random(2);
  for (const GeoPoint& centre : {GeoPoint{40.44, -79.94}, GeoPoint{-17.0, 179.995},
                                 GeoPoint{60.17, -179.999}, GeoPoint{0, 0}}) {
    const auto cells = MapCellsWithin(centre, 1500, 64);
    ASSERT_FALSE(cells.empty());
    EXPECT_EQ(cells.front(), MapCell::At(centre));
    const std::set<MapCell> set(cells.begin(), cells.end());
    EXPECT_EQ(set.size(), cells.size());
    std::set<MapCell> seen;
    for (int i = 0; i < 20000; ++i) {
      const double bearing = std::uniform_real_distribution<>(0, 6.28318)(random);
      const double distance_m = std::uniform_real_distribution<>(0, 1499.9)(random);
      seen.insert(MapCell::At(GeodesicDestination(centre, bearing, distance_m)));
    }
    EXPECT_TRUE(std::includes(set.begin(), set.end(), seen.begin(), seen.end()));
    for (const MapCell& cell : cells) EXPECT_LE(cell.DistanceM(centre), 1500);
  }
}

TEST(MapCellTest, AtAPoleTheNumberOfCellsIsBounded) {
  EXPECT_EQ(MapCellsWithin({90, 0}, 1500, 64).size(), 64U);
  EXPECT_EQ(MapCellsWithin({-89.9999, 12}, 1500, 64).size(), 64U);
  EXPECT_EQ(MapCellsWithin({89.99, 180}, 100000, 64).front(), MapCell::At({89.99, 180}));
}

TEST(MapCellTest, TheNearestCellsComeFirst) {
  const GeoPoint centre{48.1, 11.5};
  const auto cells = MapCellsWithin(centre, 3000, 10);
  ASSERT_EQ(cells.size(), 10U);
  double before_m = 0;
  for (const MapCell& cell : cells) {
    EXPECT_GE(cell.DistanceM(centre), before_m);
    before_m = cell.DistanceM(centre);
  }
  for (const MapCell& cell : MapCellsWithin(centre, 3000, 1000)) {
    if (std::find(cells.begin(), cells.end(), cell) == cells.end()) {
      EXPECT_GE(cell.DistanceM(centre), before_m);
    }
  }
}

}  // namespace
}  // namespace livemap::geo
