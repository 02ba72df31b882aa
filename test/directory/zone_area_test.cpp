#include "directory/zone_area.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "common/error.h"

namespace livemap::directory {
namespace {

using testing::HasSubstr;

ZoneArea::Ring Square(const geo::GeoPoint& south_west, double side_deg) {
  const auto [south, west] = south_west;
  const double east = west + side_deg > 180 ? west + side_deg - 360 : west + side_deg;
  return {{south, west}, {south, east}, {south + side_deg, east}, {south + side_deg, west}};
}

std::string WhyNot(std::vector<ZoneArea::Ring> rings) {
  try {
    const ZoneArea area(std::move(rings));
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ZoneArea, DepthIsTheDistanceToTheBorderPositiveInside) {
  const ZoneArea area({Square({40.40, -80.00}, 0.1)});
  // The geodesics from the point to the border, by GeographicLib.
  const geo::GeoPoint inside{40.45, -79.99};
  EXPECT_NEAR(area.DepthM(inside), geo::GeodesicDistanceM(inside, {40.45, -80.00}), 0.1);
  const geo::GeoPoint north{40.51, -79.95};
  EXPECT_NEAR(area.DepthM(north), -geo::GeodesicDistanceM(north, {40.50, -79.95}), 0.1);
  const geo::GeoPoint corner{40.51, -80.01};
  EXPECT_NEAR(area.DepthM(corner), -geo::GeodesicDistanceM(corner, {40.50, -80.00}), 1.0);
}

TEST(ZoneArea, DepthIsRightToAThousandthFarFromTheBorder) {
  const ZoneArea area({Square({52.0, 13.0}, 0.5)});
  const geo::GeoPoint far{52.25, 12.3};
  const double depth_m = geo::GeodesicDistanceM(far, {52.25, 13.0});
  EXPECT_NEAR(area.DepthM(far), -depth_m, depth_m / 1000);
}

TEST(ZoneArea, ARingWithinAnotherIsAHole) {
  const ZoneArea area({Square({40.0, -80.0}, 0.1), Square({40.04, -79.96}, 0.02)});
  EXPECT_GT(area.DepthM({40.02, -79.98}), 0);
  EXPECT_LT(area.DepthM({40.05, -79.95}), 0);
  EXPECT_NEAR(area.DepthM({40.03, -79.95}),
              geo::GeodesicDistanceM({40.03, -79.95}, {40.04, -79.95}), 0.1);
}

TEST(ZoneArea, RingsBesideEachOtherAreParts) {
  const ZoneArea area({Square({40.0, -80.0}, 0.1), Square({41.0, -80.0}, 0.1)});
  EXPECT_GT(area.DepthM({40.05, -79.95}), 0);
  EXPECT_GT(area.DepthM({41.05, -79.95}), 0);
  EXPECT_LT(area.DepthM({40.5, -79.95}), 0);
}

TEST(ZoneArea, MayLieAcrossTheAntimeridian) {
  const ZoneArea area({Square({-17.0, 179.9}, 0.2)});
  EXPECT_GT(area.DepthM({-16.9, 179.95}), 0);
  EXPECT_GT(area.DepthM({-16.9, -179.95}), 0);
  EXPECT_LT(area.DepthM({-16.9, 179.8}), 0);
  EXPECT_LT(area.DepthM({-16.9, -179.8}), 0);
  EXPECT_TRUE(area.IsNear({-16.9, -179.85}, 6000));
  EXPECT_FALSE(area.IsNear({-16.9, -179.8}, 6000));
}

TEST(ZoneArea, IsNearNeverLeavesOutWhatIsWithinTheMargin) {
  const ZoneArea area({Square({40.40, -80.00}, 0.1)});
  for (double latitude = 40.3; latitude < 40.6; latitude += 0.007) {
    for (double longitude = -80.1; longitude < -79.8; longitude += 0.007) {
      const geo::GeoPoint point{latitude, longitude};
      EXPECT_TRUE(area.DepthM(point) < -2000 || area.IsNear(point, 2000)) << latitude;
    }
  }
  EXPECT_FALSE(area.IsNear({40.53, -79.95}, 2000));
}

TEST(ZoneArea, AreasThatLieApartDoNotOverlap) {
  const ZoneArea area({Square({40.0, -80.0}, 0.1)});
  EXPECT_TRUE(area.MayOverlap(ZoneArea({Square({40.05, -79.95}, 0.1)})));
  EXPECT_FALSE(area.MayOverlap(ZoneArea({Square({40.2, -80.0}, 0.1)})));
  EXPECT_FALSE(area.MayOverlap(ZoneArea({Square({40.0, -79.8}, 0.1)})));
  const ZoneArea across({Square({0.0, 179.9}, 0.2)});
  EXPECT_TRUE(across.MayOverlap(ZoneArea({Square({0.0, -179.95}, 0.2)})));
  EXPECT_TRUE(ZoneArea({Square({0.0, -179.95}, 0.2)}).MayOverlap(across));
  EXPECT_FALSE(across.MayOverlap(ZoneArea({Square({0.0, -179.85}, 0.2)})));
}

TEST(ZoneArea, WhatIsNoAreaIsRefusedInOneSentence) {
  EXPECT_THAT(WhyNot({}), HasSubstr("the area has no ring"));
  EXPECT_THAT(WhyNot({{{40, -80}, {41, -80}}}), HasSubstr("a ring has 2 different corners"));
  EXPECT_THAT(WhyNot({{{40, -80}, {41, -80}, {91, -79}}}), HasSubstr("latitude 91.0"));
  EXPECT_THAT(WhyNot({{{86, -80}, {84, -80}, {84, -79}}}), HasSubstr("from -85 to 85"));
  EXPECT_THAT(WhyNot({{{40, -80}, {std::nan(""), -80}, {41, -79}}}), HasSubstr("latitude nan"));
  EXPECT_THAT(WhyNot({{{0, 0}, {0, 30}, {10, 30}}}), HasSubstr("spans 30"));
  // A ring around the globe.
  EXPECT_THAT(WhyNot({{{80, 0}, {80, 120}, {80, -120}}}), HasSubstr("accepted are at most 20"));
}

}  // namespace
}  // namespace livemap::directory
