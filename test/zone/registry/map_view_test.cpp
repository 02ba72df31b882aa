#include "zone/registry/map_view.h"

#include <gtest/gtest.h>

#include <cmath>

#include "zone/registry/map_origin.h"

namespace livemap::zone {
namespace {

const geo::GeoPoint kTown{40.4433, -79.9436};

double WidthDeg(const geo::GeoBox& view) {
  const double width = view.north_east.longitude_deg - view.south_west.longitude_deg;
  return width < 0 ? width + 360 : width;
}

/// Hazards around `centre`, each supported by one of the vehicles by turns.
void Scatter(const geo::GeoPoint& centre, int count, std::uint64_t first_vehicle, int vehicles,
             std::vector<ViewHazard>& hazards) {
  for (int i = 0; i < count; ++i) {
    ViewHazard hazard;
    hazard.position = geo::GeodesicDestination(centre, 2.4 * i, 3000.0 * i / count);
    hazard.supporters[0] = first_vehicle + static_cast<std::uint64_t>(i % vehicles);
    hazards.push_back(hazard);
  }
}

TEST(MapView, NothingHasNoView) { EXPECT_FALSE(ViewOf({})); }

TEST(MapView, ShowsAllHazardsOfATown) {
  std::vector<ViewHazard> hazards;
  Scatter(kTown, 90, 1, 3, hazards);
  const auto view = ViewOf(hazards);
  ASSERT_TRUE(view);
  for (const ViewHazard& hazard : hazards) EXPECT_TRUE(view->Contains(hazard.position));
  EXPECT_LT(WidthDeg(*view), 0.2);
}

TEST(MapView, AVehicleInTenCitiesDoesNotMoveIt) {
  std::vector<ViewHazard> hazards;
  Scatter(kTown, 30, 1, 3, hazards);
  const auto before = ViewOf(hazards);
  for (int city = 0; city < 10; ++city) {
    Scatter({-60.0 + 12 * city, 33.0 * city - 170}, 40, 99, 1, hazards);
  }
  const auto after = ViewOf(hazards);
  ASSERT_TRUE(before && after);
  EXPECT_NEAR(before->south_west.latitude_deg, after->south_west.latitude_deg, 1e-6);
  EXPECT_NEAR(before->north_east.longitude_deg, after->north_east.longitude_deg, 1e-6);
}

TEST(MapView, OneHazardElsewhereWeighsLessThanATown) {
  std::vector<ViewHazard> hazards;
  Scatter({-33.87, 151.21}, 1, 99, 1, hazards);
  Scatter(kTown, 30, 1, 1, hazards);
  EXPECT_TRUE(ViewOf(hazards)->Contains(kTown));
}

TEST(MapView, CrossesTheAntimeridianAsANarrowBox) {
  for (const double longitude_deg : {179.9999, -179.9999, 180.0, -180.0}) {
    std::vector<ViewHazard> hazards;
    Scatter({-17.8, longitude_deg}, 50, 1, 2, hazards);
    const auto view = ViewOf(hazards);
    ASSERT_TRUE(view);
    EXPECT_GT(view->south_west.longitude_deg, view->north_east.longitude_deg);
    EXPECT_LT(WidthDeg(*view), 0.2);
    for (const ViewHazard& hazard : hazards) EXPECT_TRUE(view->Contains(hazard.position));
  }
}

TEST(MapView, HoldsAtThePoles) {
  for (const double latitude_deg : {90.0, -90.0, 89.9999}) {
    std::vector<ViewHazard> hazards;
    Scatter({latitude_deg, 30}, 50, 1, 2, hazards);
    const auto view = ViewOf(hazards);
    ASSERT_TRUE(view);
    EXPECT_TRUE(geo::IsValid(view->south_west) && geo::IsValid(view->north_east));
    EXPECT_LT(view->south_west.latitude_deg, view->north_east.latitude_deg);
    for (const ViewHazard& hazard : hazards) {
      EXPECT_TRUE(view->Contains(hazard.position))
          << hazard.position.latitude_deg << " " << hazard.position.longitude_deg;
    }
  }
}

TEST(MapView, OnePlaceHasAViewOfAKilometre) {
  std::vector<ViewHazard> hazards(1);
  hazards[0].position = kTown;
  const auto view = ViewOf(hazards);
  ASSERT_TRUE(view);
  EXPECT_NEAR(geo::GeodesicDistanceM(view->south_west, view->north_east), 1414, 30);
}

TEST(MapOrigin, OnePlaceAloneIsNone) {
  MapOrigin origin;
  EXPECT_FALSE(origin.AddHazard({1e-6, 0}, 1));
  EXPECT_FALSE(origin.AddHazard(kTown, 1));
  EXPECT_FALSE(origin.AddHazard(geo::GeodesicDestination(kTown, 1, 500), 1));
  const auto found = origin.AddHazard(geo::GeodesicDestination(kTown, 2, 900), 1);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->latitude_deg, kTown.latitude_deg);
}

TEST(MapOrigin, AHazardThatTwoVehiclesSawCountsAsTwo) {
  MapOrigin origin;
  EXPECT_FALSE(origin.AddHazard(kTown, 1));
  EXPECT_TRUE(origin.AddHazard(kTown, 2));
}

TEST(MapOrigin, AVehicleVotesOnceInAWhile) {
  MapOrigin origin;
  for (int i = 0; i < 9; ++i) {
    EXPECT_FALSE(origin.AddVehicle("car-1", {1e-6, 0}, i * 1'000'000'000LL));
  }
  EXPECT_FALSE(origin.AddVehicle("car-2", kTown, 1));
  EXPECT_FALSE(origin.AddVehicle("car-3", kTown, 2));
  EXPECT_TRUE(origin.AddVehicle("car-4", kTown, 3));
}

TEST(MapOrigin, PlacesAgreeAcrossTheAntimeridian) {
  MapOrigin origin;
  EXPECT_FALSE(origin.AddHazard({-17, 179.9999}, 1));
  EXPECT_TRUE(origin.AddHazard({-17, -179.9999}, 2));
}

}  // namespace
}  // namespace livemap::zone
