#include "simulation/world/skyline.h"

#include <gtest/gtest.h>

#include <cmath>

#include "simulation/render/street_scene.h"

namespace livemap::simulation {
namespace {

WorldDescription HousesOnly() {
  WorldDescription world;
  world.pieces = {{2000, 0, 0}};
  world.trees = false;
  world.parked_cars = false;
  world.hazards.emplace();
  return world;
}

/// Elevation below which a ray across the street meets something, radians.
double SeenElevation(const StreetScene& scene, const Vec3& eye, double side) {
  double highest = 0;
  for (double elevation = 0.05; elevation < 1.5; elevation += 0.05) {
    const Vec3 direction(0, static_cast<float>(side * std::cos(elevation)),
                         static_cast<float>(std::sin(elevation)));
    if (scene.Cast(eye, direction, 0.1F, 30.0F).found) highest = elevation;
  }
  return highest;
}

TEST(Skyline, AgreesOnTheWholeWithWhatRaysAcrossTheStreetMeet) {
  const Street street(HousesOnly(), 3, 1000, true);
  StreetScene scene(street);
  const double left_m = street.lane_left_m();
  double stated_left = 0;
  double stated_right = 0;
  double seen_left = 0;
  double seen_right = 0;
  int count = 0;
  for (double along = 40; along < 1000; along += 8, ++count) {
    scene.MoveTo(along);
    const Eigen::Vector3d place = street.line().At(along, left_m, kAntennaHeightM);
    const Vec3 eye = (place - scene.origin()).cast<float>();
    seen_left += SeenElevation(scene, eye, 1);
    seen_right += SeenElevation(scene, eye, -1);
    const datasets::SkyVisibility sky = SkyOver(street, along, left_m);
    stated_left += sky.left_rad;
    stated_right += sky.right_rad;
  }
  EXPECT_NEAR(stated_left / count, seen_left / count, 0.12);
  EXPECT_NEAR(stated_right / count, seen_right / count, 0.12);
  EXPECT_GT(seen_left / count, 0.2) << "the street has houses";
  EXPECT_GT(stated_right, stated_left) << "the vehicle drives nearer to the right side";
}

TEST(Skyline, ParksAreOpenAndShopsHideAThirdOfTheSky) {
  WorldDescription world = HousesOnly();
  world.crossings_m.emplace();
  const Street street(world, 3, 20000, true);
  double least = 1;
  double most = 0;
  for (double along = 0; along < 20000; along += 20) {
    const double hidden = SkyOver(street, along, 0).HiddenShare();
    least = std::min(least, hidden);
    most = std::max(most, hidden);
  }
  EXPECT_EQ(least, 0);
  EXPECT_GT(most, 0.33);
  EXPECT_LT(most, 0.7);
}

TEST(Skyline, ACrossingOpensTheSky) {
  WorldDescription world = HousesOnly();
  world.crossings_m = std::vector<double>{};
  const Street closed(world, 3, 1000, true);
  double along = 100;
  while (SkyOver(closed, along, 0).HiddenShare() < 0.3) along += 20;
  world.crossings_m = std::vector<double>{along};
  const Street open(world, 3, 1000, true);
  EXPECT_LT(SkyOver(open, along, 0).HiddenShare(), 0.8 * SkyOver(closed, along, 0).HiddenShare());
}

TEST(Skyline, StreetWithoutHousesIsOpen) {
  WorldDescription world = HousesOnly();
  world.buildings = false;
  const Street street(world, 3, 1000, true);
  for (double along = 0; along < 1000; along += 20) {
    EXPECT_EQ(SkyOver(street, along, -1.6).HiddenShare(), 0);
  }
}

TEST(Skyline, MultipathIsLargerBetweenHousesThanInAPark) {
  WorldDescription world = HousesOnly();
  world.crossings_m.emplace();
  const Street street(world, 3, 20000, true);
  datasets::GnssMultipath multipath(2, 7);
  double between_houses = 0;
  double in_park = 0;
  int houses = 0;
  int parks = 0;
  for (double along = 0; along < 20000; along += 5) {
    const datasets::SkyVisibility sky = SkyOver(street, along, street.lane_left_m());
    const double squared = multipath.ErrorAt(along / 8, along, 0, sky).squaredNorm();
    if (sky.HiddenShare() > 0.4) between_houses += squared, ++houses;
    if (sky.HiddenShare() < 0.05) in_park += squared, ++parks;
  }
  ASSERT_GT(houses, 100);
  ASSERT_GT(parks, 100);
  EXPECT_GT(std::sqrt(between_houses / houses), 1.5);
  EXPECT_LT(std::sqrt(in_park / parks), 0.2);
}

}  // namespace
}  // namespace livemap::simulation
