#include "protocol/duplicate_filter.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdint>
#include <random>

#include "common/error.h"
#include "geo/wgs84.h"

namespace livemap::protocol {
namespace {

constexpr geo::GeoPoint kStreet{40.4433, -79.9436};

geo::GeoPoint East(double distance_m) {
  return geo::GeodesicDestination(kStreet, M_PI / 2, distance_m);
}

Uuid Id(int number) {
  Uuid id;
  id.bytes[0] = 1;
  id.bytes[14] = static_cast<std::uint8_t>(number / 256);
  id.bytes[15] = static_cast<std::uint8_t>(number % 256);
  return id;
}

TEST(DuplicateFilter, SameClassWithinTheRadiusIsADuplicate) {
  DuplicateFilter filter{HazardCatalogue()};
  filter.Put(Id(1), "pothole", kStreet);
  const auto match = filter.Find("pothole", East(4.99));
  ASSERT_TRUE(match);
  EXPECT_EQ(match->id, Id(1));
  EXPECT_NEAR(match->distance_m, 4.99, 1e-6);
  EXPECT_FALSE(filter.Find("pothole", East(5.01)));
}

TEST(DuplicateFilter, AnotherClassIsAnotherHazard) {
  DuplicateFilter filter{HazardCatalogue()};
  filter.Put(Id(1), "pothole", kStreet);
  EXPECT_FALSE(filter.Find("debris", kStreet));
}

TEST(DuplicateFilter, RadiusIsTheOneOfTheClass) {
  DuplicateFilter filter{HazardCatalogue::Parse(
      "classes: {deer: {duplicate_radius_m: 50}, cone: {duplicate_radius_m: 1}}", "test")};
  filter.Put(Id(1), "deer", kStreet);
  filter.Put(Id(2), "cone", kStreet);
  EXPECT_TRUE(filter.Find("deer", East(49)));
  EXPECT_FALSE(filter.Find("deer", East(51)));
  EXPECT_FALSE(filter.Find("cone", East(1.1)));
}

TEST(DuplicateFilter, MovedHazardIsKnownAtItsNewPlaceOnly) {
  DuplicateFilter filter{HazardCatalogue()};
  filter.Put(Id(1), "pothole", kStreet);
  filter.Put(Id(1), "pothole", East(20));
  EXPECT_EQ(filter.size(), 1u);
  EXPECT_FALSE(filter.Find("pothole", kStreet));
  EXPECT_TRUE(filter.Find("pothole", East(20)));
}

TEST(DuplicateFilter, RemovedHazardIsNoLongerKnown) {
  DuplicateFilter filter{HazardCatalogue()};
  filter.Put(Id(1), "pothole", kStreet);
  filter.Put(Id(2), "pothole", East(8));
  EXPECT_TRUE(filter.Remove(Id(1)));
  EXPECT_FALSE(filter.Remove(Id(1)));
  EXPECT_FALSE(filter.Knows(Id(1)));
  EXPECT_EQ(filter.Find("pothole", East(4))->id, Id(2)) << "the other one is still there";
}

TEST(DuplicateFilter, InvalidPositionIsNeverADuplicateAndNeverKept) {
  DuplicateFilter filter{HazardCatalogue()};
  EXPECT_THROW(filter.Put(Id(1), "pothole", {std::nan(""), 0}), Error);
  filter.Put(Id(1), "pothole", kStreet);
  EXPECT_FALSE(filter.Find("pothole", {std::nan(""), 0}));
}

TEST(DuplicateFilter, AgreesWithBruteForceOverClassesMovesAndRemovals) {
  struct Known {
    std::string class_name;
    geo::GeoPoint position;
  };
  const std::vector<std::string> classes = {"pothole", "deer", "cone"};
  const auto catalogue = HazardCatalogue::Parse(
      "classes: {deer: {duplicate_radius_m: 25}, cone: {duplicate_radius_m: 1.5}}", "test");
  // Astride the antimeridian, where naive grids miss neighbours.
  const geo::GeoPoint centre{64.0, 179.99995};
  std::mt19937_64 random{7};
  std::uniform_real_distribution<double> unit(0, 1);
  const auto scatter = [&] {
    return geo::GeodesicDestination(centre, 2 * M_PI * unit(random), 100 * unit(random));
  };
  DuplicateFilter filter(catalogue);
  std::map<Uuid, Known> known;
  for (int round = 0; round < 4000; ++round) {
    const Uuid id = Id(static_cast<std::uint8_t>(random() % 120));
    if (random() % 3 == 0) {
      EXPECT_EQ(filter.Remove(id), known.erase(id) == 1);
    } else {
      known[id] = {classes[random() % 3], scatter()};
      filter.Put(id, known[id].class_name, known[id].position);
    }
    ASSERT_EQ(filter.size(), known.size());
    const std::string class_name = classes[random() % 3];
    const geo::GeoPoint sighting = scatter();
    std::optional<DuplicateFilter::Match> expected;
    for (const auto& [other, hazard] : known) {
      const double distance_m = geo::GeodesicDistanceM(hazard.position, sighting);
      if (hazard.class_name != class_name || distance_m > catalogue.DuplicateRadiusM(class_name)) {
        continue;
      }
      if (!expected || distance_m < expected->distance_m) expected = {other, distance_m};
    }
    const auto match = filter.Find(class_name, sighting);
    ASSERT_EQ(match.has_value(), expected.has_value()) << "round " << round;
    if (!expected) continue;
    EXPECT_EQ(match->id, expected->id);
  }
}

}  // namespace
}  // namespace livemap::protocol
