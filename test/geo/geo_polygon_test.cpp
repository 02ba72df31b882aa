#include "geo/geo_polygon.h"

#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::geo {
namespace {

TEST(GeoPolygonTest, HoldsWhatIsInsideOfAShapeWithADent) {
  const GeoPolygon area({{0, 0}, {0, 4}, {4, 4}, {1, 2}, {4, 0}});
  EXPECT_TRUE(area.Contains({0.5, 2}));
  EXPECT_TRUE(area.Contains({3, 0.3}));
  EXPECT_FALSE(area.Contains({3, 2}));
  EXPECT_FALSE(area.Contains({-0.1, 2}));
  EXPECT_FALSE(area.Contains({2, 4.1}));
}

TEST(GeoPolygonTest, LiesAcrossTheAntimeridian) {
  const GeoPolygon area({{-1, 179}, {-1, -179}, {1, -179}, {1, 179}});
  EXPECT_TRUE(area.Contains({0, 179.5}));
  EXPECT_TRUE(area.Contains({0, -179.5}));
  EXPECT_TRUE(area.Contains({0, 180}));
  EXPECT_FALSE(area.Contains({0, 178.5}));
  EXPECT_FALSE(area.Contains({0, -178.5}));
  EXPECT_FALSE(area.Contains({0, 0}));
}

TEST(GeoPolygonTest, RefusesWhatIsNoArea) {
  EXPECT_THROW(GeoPolygon({{0, 0}, {1, 1}}), Error);
  EXPECT_THROW(GeoPolygon({{0, 0}, {1, 1}, {95, 0}}), Error);
}

}  // namespace
}  // namespace livemap::geo
