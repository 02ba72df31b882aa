#include "geo/spatial_grid.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "common/error.h"

namespace livemap::geo {
namespace {

struct Place {
  GeoPoint point;
  std::uint64_t id;
};

std::optional<SpatialGrid::Neighbour> NearestByBruteForce(const std::vector<Place>& places,
                                                          const GeoPoint& centre, double radius_m) {
  std::optional<SpatialGrid::Neighbour> nearest;
  for (const Place& place : places) {
    const double distance_m = GeodesicDistanceM(place.point, centre);
    if (distance_m > radius_m) continue;
    if (!nearest || distance_m < nearest->distance_m) nearest = {place.id, distance_m};
  }
  return nearest;
}

/// Corners of the earth where flat or latitude-longitude grids go wrong.
class SpatialGridAt : public ::testing::TestWithParam<GeoPoint> {
 protected:
  /// A random place up to `reach_m` from the parameter.
  GeoPoint Scatter(double reach_m) {
    std::uniform_real_distribution<double> bearing(0, 2 * M_PI);
    std::uniform_real_distribution<double> distance(0, reach_m);
    return GeodesicDestination(GetParam(), bearing(random_), distance(random_));
  }

  std::mt19937_64 random_{20191121};
};

TEST_P(SpatialGridAt, FindsWhatBruteForceFindsWhilePlacesComeAndGo) {
  for (const double radius_m : {5.0, 31.0}) {
    SpatialGrid grid(30.0);
    std::vector<Place> places;
    for (std::uint64_t round = 0; round < 400; ++round) {
      if (round % 3 == 2) {
        const std::size_t victim = random_() % places.size();
        ASSERT_TRUE(grid.Erase(places[victim].point, places[victim].id));
        places.erase(places.begin() + static_cast<std::ptrdiff_t>(victim));
      } else {
        places.push_back({Scatter(150.0), round});
        grid.Insert(places.back().point, round);
      }
      if (round % 2 == 0) {
        // A long way, or a short one within the cell.
        Place& moved = places[random_() % places.size()];
        const GeoPoint to =
            round % 4 == 0 ? Scatter(150.0) : GeodesicDestination(moved.point, 1, 1);
        ASSERT_TRUE(grid.Move(moved.point, to, moved.id));
        moved.point = to;
      }
      ASSERT_EQ(grid.size(), places.size());
      const GeoPoint centre = Scatter(160.0);
      const auto expected = NearestByBruteForce(places, centre, radius_m);
      const auto found = grid.Nearest(centre, radius_m);
      ASSERT_EQ(found.has_value(), expected.has_value()) << "round " << round;
      if (!expected) continue;
      EXPECT_EQ(found->id, expected->id);
      EXPECT_EQ(found->distance_m, expected->distance_m);
    }
  }
}

TEST_P(SpatialGridAt, FindsEveryPlaceWithinTheRadiusOnce) {
  for (const double radius_m : {5.0, 31.0, 100.0}) {
    SpatialGrid grid(30.0);
    std::vector<Place> places;
    for (std::uint64_t id = 0; id < 300; ++id) {
      places.push_back({Scatter(150.0), id});
      grid.Insert(places.back().point, id);
    }
    const GeoPoint centre = Scatter(160.0);
    std::vector<std::uint64_t> expected;
    for (const Place& place : places) {
      if (GeodesicDistanceM(place.point, centre) <= radius_m) expected.push_back(place.id);
    }
    std::vector<std::uint64_t> found;
    for (const auto& neighbour : grid.Within(centre, radius_m)) found.push_back(neighbour.id);
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, expected);
  }
}

TEST_P(SpatialGridAt, DecidesToTheMillimetreInEveryDirection) {
  for (int direction = 0; direction < 36; ++direction) {
    SpatialGrid grid(30.0);
    grid.Insert(GetParam(), 7);
    const double bearing = direction * M_PI / 18;
    EXPECT_TRUE(grid.Nearest(GeodesicDestination(GetParam(), bearing, 4.999), 5.0));
    EXPECT_FALSE(grid.Nearest(GeodesicDestination(GetParam(), bearing, 5.001), 5.0));
  }
}

INSTANTIATE_TEST_SUITE_P(Places, SpatialGridAt,
                         ::testing::Values(GeoPoint{40.4433, -79.9436}, GeoPoint{0.0, 0.0},
                                           GeoPoint{-16.5, 180.0}, GeoPoint{-16.5, -180.0},
                                           GeoPoint{78.2232, 15.6267}, GeoPoint{89.9999, 12.0},
                                           GeoPoint{90.0, 0.0}, GeoPoint{-89.99999, -170.0}));

TEST(SpatialGrid, KeepsEveryPlaceWhileItGrows) {
  std::mt19937_64 random{4};
  std::uniform_real_distribution<double> latitude(-90, 90);
  std::uniform_real_distribution<double> longitude(-180, 180);
  SpatialGrid grid(30.0);
  std::vector<GeoPoint> places;
  for (std::uint64_t id = 0; id < 20000; ++id) {
    places.push_back({latitude(random), longitude(random)});
    grid.Insert(places.back(), id);
  }
  for (std::uint64_t id = 0; id < places.size(); ++id) {
    const auto found = grid.Nearest(places[id], 0.001);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->id, id);
  }
}

TEST(SpatialGrid, PrefersTheLowestIdAmongEqualDistances) {
  SpatialGrid grid(30.0);
  for (const std::uint64_t id : {4U, 2U, 3U}) grid.Insert({10, 10}, id);
  EXPECT_EQ(grid.Nearest({10, 10.00001}, 5.0)->id, 2U);
}

TEST(SpatialGrid, FindsTheSameWhateverTheSeed) {
  std::mt19937_64 random{5};
  std::uniform_real_distribution<double> offset(0, 0.003);
  SpatialGrid first = SpatialGrid::ForRadius(5.0, 1);
  SpatialGrid second = SpatialGrid::ForRadius(5.0, 0xfeedface12345678u);
  for (std::uint64_t id = 0; id < 3000; ++id) {
    const GeoPoint place{50 + offset(random), 8 + offset(random)};
    first.Insert(place, id);
    second.Insert(place, id);
  }
  for (int i = 0; i < 300; ++i) {
    const GeoPoint query{50 + offset(random), 8 + offset(random)};
    const auto found = first.Nearest(query, 5.0);
    const auto expected = second.Nearest(query, 5.0);
    ASSERT_EQ(found.has_value(), expected.has_value());
    if (found) {
      EXPECT_EQ(found->id, expected->id);
    }
  }
}

TEST(SpatialGrid, ErasingWhatIsNotThereChangesNothing) {
  SpatialGrid grid(30.0);
  grid.Insert({10, 20}, 1);
  EXPECT_FALSE(grid.Erase({10, 20}, 2));
  EXPECT_FALSE(grid.Erase({10, 21}, 1));
  EXPECT_FALSE(grid.Move({10, 21}, {10, 20}, 1));
  EXPECT_FALSE(grid.Erase({std::nan(""), 20}, 1));
  EXPECT_EQ(grid.size(), 1u);
}

TEST(SpatialGrid, RefusesImpossiblePlacesAndCells) {
  SpatialGrid grid(30.0);
  EXPECT_THROW(grid.Insert({91, 0}, 1), Error);
  EXPECT_THROW(grid.Insert({std::nan(""), 0}, 1), Error);
  EXPECT_FALSE(grid.Nearest({0, std::nan("")}, 5.0));
  EXPECT_FALSE(grid.Nearest({0, 0}, std::nan("")));
  EXPECT_THROW(SpatialGrid(0.0), Error);
  EXPECT_THROW(SpatialGrid(std::nan("")), Error);
}

}  // namespace
}  // namespace livemap::geo
