#include "zone/hazard_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace livemap {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct World {
  HazardGrid grid;
  std::vector<GeoPoint> points;

  explicit World(double radius_m) : grid(radius_m, 99) {}

  void Add(const GeoPoint& point) {
    grid.Insert(point, static_cast<HazardGrid::Slot>(points.size()));
    points.push_back(point);
  }
  std::optional<HazardGrid::Neighbour> Nearest(const GeoPoint& query) const {
    return grid.Nearest(
        query, [&](HazardGrid::Slot slot) { return GeodesicDistanceM(query, points[slot]); });
  }
  std::optional<HazardGrid::Neighbour> NearestByLookingAtAll(const GeoPoint& query,
                                                             double radius_m) const {
    std::optional<HazardGrid::Neighbour> best;
    for (HazardGrid::Slot slot = 0; slot < points.size(); ++slot) {
      const double distance_m = GeodesicDistanceM(query, points[slot]);
      if (distance_m > radius_m || (best && distance_m >= best->distance_m)) continue;
      best = HazardGrid::Neighbour{slot, distance_m};
    }
    return best;
  }
};

/// Around which a search must not miss anything: ordinary places, both poles, the antimeridian,
/// corners of the coordinate range and the borders of cells.
const std::vector<GeoPoint> kPlaces{{40.44, -79.94},  {0, 0},          {0, 180},
                                    {0, -180},        {-16.8, 180},    {71.0, -180},
                                    {89.99999, 12},   {90, 0},         {90, 180},
                                    {-90, -180},      {-89.9999, 179}, {85, -179.999999},
                                    {-0.00001, 1e-7}, {89.999955, 0},  {-29.7, -53.7}};

TEST(HazardGrid, FindsAtACentimetreInsideTheRadiusAndNotACentimetreOutside) {
  for (const double radius_m : {0.1, 5.0, 30.0, 1000.0}) {
    for (const GeoPoint& place : kPlaces) {
      World world(radius_m);
      world.Add(place);
      for (double bearing = 0; bearing < 2 * kPi; bearing += 0.25) {
        EXPECT_TRUE(world.Nearest(GeodesicDestination(place, bearing, radius_m - 0.01)))
            << place.latitude_deg << " " << place.longitude_deg << " " << bearing;
        EXPECT_FALSE(world.Nearest(GeodesicDestination(place, bearing, radius_m + 0.01)))
            << place.latitude_deg << " " << place.longitude_deg << " " << bearing;
      }
    }
  }
}

TEST(HazardGrid, AgreesWithLookingAtEverythingWhateverThePlace) {
  constexpr double kRadiusM = 5.0;
  std::mt19937_64 generator(5);
  std::uniform_real_distribution<double> bearing(0, 2 * kPi);
  std::uniform_real_distribution<double> distance_m(0, 30);
  for (const GeoPoint& place : kPlaces) {
    World world(kRadiusM);
    const auto near_place = [&] {
      return GeodesicDestination(place, bearing(generator), distance_m(generator));
    };
    for (int i = 0; i < 60; ++i) world.Add(near_place());
    for (int i = 0; i < 100; ++i) {
      const GeoPoint query = near_place();
      const auto expected = world.NearestByLookingAtAll(query, kRadiusM);
      const auto found = world.Nearest(query);
      ASSERT_EQ(found.has_value(), expected.has_value());
      if (found) {
        EXPECT_EQ(found->slot, expected->slot);
      }
    }
  }
}

TEST(HazardGrid, PrefersTheLowerSlotAmongEqualDistances) {
  World world(5.0);
  world.Add({10, 10});
  world.Add({10, 10});
  EXPECT_EQ(world.Nearest({10, 10.00001})->slot, 0U);
}

TEST(HazardGrid, ForgetsExactlyWhatIsErased) {
  World world(5.0);
  std::mt19937_64 generator(6);
  std::uniform_real_distribution<double> offset(0, 0.003);
  for (int i = 0; i < 3000; ++i) world.Add({50 + offset(generator), 8 + offset(generator)});
  std::vector<HazardGrid::Slot> order(world.points.size());
  for (HazardGrid::Slot slot = 0; slot < order.size(); ++slot) order[slot] = slot;
  std::shuffle(order.begin(), order.end(), generator);
  for (std::size_t i = 0; i < order.size() / 2; ++i) {
    world.grid.Erase(world.points[order[i]], order[i]);
    world.points[order[i]] = {-50, 0};  // So that the slow search forgets it too.
  }
  EXPECT_EQ(world.grid.size(), order.size() / 2);
  for (int i = 0; i < 300; ++i) {
    const GeoPoint query{50 + offset(generator), 8 + offset(generator)};
    const auto expected = world.NearestByLookingAtAll(query, 5.0);
    const auto found = world.Nearest(query);
    ASSERT_EQ(found.has_value(), expected.has_value());
    if (found) {
      EXPECT_EQ(found->slot, expected->slot);
    }
  }
}

}  // namespace
}  // namespace livemap
