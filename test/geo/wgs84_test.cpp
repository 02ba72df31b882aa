#include "geo/wgs84.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "common/error.h"

namespace livemap::geo {
namespace {

constexpr double kPi = 3.14159265358979323846;

TEST(Wgs84, DistanceMatchesPublishedGeodesics) {
  // JFK - LHR and the quarter meridian: values of GeographicLib's documentation and of WGS84.
  EXPECT_NEAR(GeodesicDistanceM({40.6, -73.8}, {51.6, -0.5}), 5551759.400, 0.001);
  EXPECT_NEAR(GeodesicDistanceM({0, 0}, {90, 0}), 10001965.729, 0.001);
  EXPECT_NEAR(GeodesicDistanceM({0, 179.99999}, {0, -179.99999}), 2.2264, 0.001);
}

TEST(Wgs84, AChordIsAlmostAsLongAsTheGeodesic) {
  for (const GeoPoint start :
       {GeoPoint{40, -79}, GeoPoint{89.99999, 10}, GeoPoint{-17, 179.9999}}) {
    const GeoPoint end = GeodesicDestination(start, 1.0, 100.0);
    EXPECT_NEAR((EarthCentred(start) - EarthCentred(end)).norm(), 100.0, 1e-6);
  }
  EXPECT_NEAR(EarthCentred({0, 90}).y(), 6378137.0, 1e-6);
}

TEST(Wgs84, DestinationLiesAtTheDistanceAlsoAcrossPoleAndAntimeridian) {
  for (const GeoPoint start : {GeoPoint{40, -79}, GeoPoint{89.99999, 10}, GeoPoint{-90, 0},
                               GeoPoint{-17, 179.99999}, GeoPoint{69, -180}}) {
    for (double bearing = 0; bearing < 2 * kPi; bearing += 0.4) {
      const GeoPoint end = GeodesicDestination(start, bearing, 5.0);
      ASSERT_TRUE(IsValid(end));
      EXPECT_NEAR(GeodesicDistanceM(start, end), 5.0, 1e-6);
    }
  }
}

TEST(Wgs84, RefusesWhatIsNoPosition) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(IsValid({90, -180}));
  EXPECT_FALSE(IsValid({90.0000001, 0}));
  EXPECT_FALSE(IsValid({0, -180.0000001}));
  EXPECT_FALSE(IsValid({kNan, 0}));
  EXPECT_FALSE(IsValid({0, kNan}));
  EXPECT_FALSE(IsValid({0, kInfinity}));
  EXPECT_THROW(LocalFrame({kNan, 0}), Error);
}

TEST(LocalFrame, IsTheInverseOfItself) {
  for (const GeoPoint datum : {GeoPoint{40.44, -79.94}, GeoPoint{0, 180}, GeoPoint{-89.9, 3}}) {
    const LocalFrame frame(datum);
    EXPECT_LT(frame.ToEnu(datum).norm(), 1e-9);
    for (double east = -50000; east <= 50000; east += 12500) {
      for (double north = -50000; north <= 50000; north += 12500) {
        const Eigen::Vector2d enu(east, north);
        EXPECT_LT((frame.ToEnu(frame.ToGeo(enu)) - enu).norm(), 1e-6);
      }
    }
  }
}

TEST(LocalFrame, StandsOnTheEarthWithEastNorthAndUpAsItsAxes) {
  // At latitude 0, longitude 90 east is -x, north is z and up is y of the earth.
  const Eigen::Isometry3d pose = LocalFrame({0, 90}).InEarth();
  EXPECT_NEAR((pose.translation() - Eigen::Vector3d(0, 6378137.0, 0)).norm(), 0.0, 1e-6);
  EXPECT_NEAR((pose.linear() * Eigen::Vector3d::UnitX() + Eigen::Vector3d::UnitX()).norm(), 0,
              1e-12);
  EXPECT_NEAR((pose.linear() * Eigen::Vector3d::UnitY() - Eigen::Vector3d::UnitZ()).norm(), 0,
              1e-12);
  EXPECT_NEAR((pose.linear() * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitY()).norm(), 0,
              1e-12);
}

TEST(LocalFrame, AgreesWithGeodesicsNearTheDatum) {
  const GeoPoint datum{-29.7, -53.7};
  const LocalFrame frame(datum);
  const Eigen::Vector2d enu = frame.ToEnu(GeodesicDestination(datum, kPi / 3, 100.0));
  EXPECT_NEAR(enu.x(), 100.0 * std::sin(kPi / 3), 1e-4);
  EXPECT_NEAR(enu.y(), 100.0 * std::cos(kPi / 3), 1e-4);
}

}  // namespace
}  // namespace livemap::geo
