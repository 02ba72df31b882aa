#include "protocol/cross_zone_duplicates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

#include "geo/wgs84.h"

namespace livemap::protocol {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

struct BorderHazard {
  Uuid id;
  std::string class_name;
  geo::GeoPoint position;
};

BorderHazard HazardAt(std::uint8_t number, double east_m, const std::string& name = "pothole") {
  BorderHazard hazard;
  hazard.id.bytes[15] = number;
  hazard.class_name = name;
  hazard.position = geo::GeodesicDestination({49.2, 7.0}, M_PI / 2, east_m);
  return hazard;
}

class CrossZoneDuplicatesTest : public testing::Test {
 protected:
  /// Numbers of the hazards that are shown now, in their order.
  std::vector<int> Put(const BorderHazard& hazard, const std::string& zone) {
    CrossZoneDuplicates<BorderHazard>::Changes changes;
    duplicates_.Put(hazard, zone, changes);
    return Show(changes);
  }
  std::vector<int> Remove(std::uint8_t number) {
    CrossZoneDuplicates<BorderHazard>::Changes changes;
    duplicates_.Remove(HazardAt(number, 0).id, changes);
    return Show(changes);
  }
  std::vector<int> Show(const CrossZoneDuplicates<BorderHazard>::Changes& changes) {
    for (const BorderHazard& hazard : changes.put) there_.insert(hazard.id.bytes[15]);
    for (const Uuid& id : changes.gone) there_.erase(id.bytes[15]);
    return {there_.begin(), there_.end()};
  }

  CrossZoneDuplicates<BorderHazard> duplicates_{HazardCatalogue()};
  const double radius_m_ = HazardCatalogue().DuplicateRadiusM("pothole");
  std::set<int> there_;
};

TEST_F(CrossZoneDuplicatesTest, AHazardThatTwoZonesAnnounceIsShownOnceAndTheFirstOneStays) {
  EXPECT_THAT(Put(HazardAt(1, 0), "west"), ElementsAre(1));
  EXPECT_THAT(Put(HazardAt(2, radius_m_ / 2), "east"), ElementsAre(1));
  EXPECT_THAT(Put(HazardAt(1, 0.1), "west"), ElementsAre(1)) << "news of it";
  EXPECT_THAT(Put(HazardAt(2, radius_m_ / 3), "east"), ElementsAre(1));
  EXPECT_EQ(duplicates_.hidden(), 1U);
}

TEST_F(CrossZoneDuplicatesTest, HazardsOfOneZoneOfAnotherClassOrFartherApartAreAllShown) {
  Put(HazardAt(1, 0), "west");
  EXPECT_THAT(Put(HazardAt(2, radius_m_ / 2), "west"), ElementsAre(1, 2));
  EXPECT_THAT(Put(HazardAt(5, radius_m_ / 2), ""), ElementsAre(1, 2, 5)) << "of no named zone";
  Remove(5);
  EXPECT_THAT(Put(HazardAt(3, 0, "debris"), "east"), ElementsAre(1, 2, 3));
  EXPECT_THAT(Put(HazardAt(4, radius_m_ * 2), "east"), ElementsAre(1, 2, 3, 4));
}

TEST_F(CrossZoneDuplicatesTest, WhenTheShownOneIsGoneTheOtherZonesTakesItsPlace) {
  Put(HazardAt(1, 0), "west");
  Put(HazardAt(2, radius_m_ / 2), "east");
  EXPECT_THAT(Remove(1), ElementsAre(2));
  EXPECT_EQ(duplicates_.hidden(), 0U);
  EXPECT_THAT(Remove(2), IsEmpty());
}

TEST_F(CrossZoneDuplicatesTest, WhatIsTakenBackWhileItIsNotShownDoesNotComeBack) {
  Put(HazardAt(1, 0), "west");
  Put(HazardAt(2, radius_m_ / 2), "east");
  EXPECT_THAT(Remove(2), ElementsAre(1));
  EXPECT_THAT(Remove(1), IsEmpty());
}

TEST_F(CrossZoneDuplicatesTest, OnesThatMoveApartAreBothShownAndOnesThatMeetAreOne) {
  Put(HazardAt(1, 0), "west");
  Put(HazardAt(2, radius_m_ / 2), "east");
  EXPECT_THAT(Put(HazardAt(1, -2 * radius_m_), "west"), ElementsAre(1, 2));
  EXPECT_THAT(Put(HazardAt(1, 0), "west"), ElementsAre(2)) << "it is the one that moved";
  EXPECT_THAT(Put(HazardAt(2, 3 * radius_m_), "east"), ElementsAre(1, 2));
}

TEST_F(CrossZoneDuplicatesTest, WithinOneSetOfChangesTheLastWordCounts) {
  Put(HazardAt(1, 0), "west");
  Put(HazardAt(2, 10 * radius_m_), "east");
  CrossZoneDuplicates<BorderHazard>::Changes changes;
  duplicates_.Put(HazardAt(1, 10 * radius_m_), "west", changes);
  duplicates_.Put(HazardAt(2, 20 * radius_m_), "east", changes);
  EXPECT_THAT(changes.gone, IsEmpty());
  EXPECT_THAT(Show(changes), ElementsAre(1, 2));
}

}  // namespace
}  // namespace livemap::protocol
