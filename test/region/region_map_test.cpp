#include "region/region_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "geo/wgs84.h"
#include "test/region/told_hazards.h"

namespace livemap::region {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

geo::GeoPoint EastBy(double east_m) {
  return geo::GeodesicDestination({40.44, -79.94}, M_PI / 2, east_m);
}

class RegionMapTest : public testing::Test {
 protected:
  RegionMapTest() {
    subscription_ = map_.Subscribe([this](const zone::ZoneEvent& event) {
      events_.push_back(std::to_string(static_cast<int>(event.hazard->action)) + ' ' +
                        NameOf(event.hazard->hazard.uuid));
      sequences_.push_back(event.hazard->hazard.sequence);
      announced_.push_back(event.hazard->announced);
    });
  }
  ~RegionMapTest() override { map_.Unsubscribe(subscription_); }

  /// "north 1".
  static std::string NameOf(const Uuid& id) {
    for (const char* zone : {"north", "south"}) {
      for (std::uint8_t number = 1; number < 10; ++number) {
        if (RegionHazardId(zone, IdOf(number)) == id) {
          return std::string(zone) + ' ' + std::to_string(number);
        }
      }
    }
    return id.ToString();
  }
  std::vector<std::string> Listed(zone::HazardStates states = zone::StatesOnMap(),
                                  std::uint64_t after = 0) const {
    zone::Walk<zone::HazardState> walk;
    walk.states = std::move(states);
    walk.after = after;
    std::vector<std::string> names;
    for (const zone::Hazard& hazard : zone::ReadItems(
             walk, 100,
             [this](const auto&where, std::size_t) { return map_.ReadHazards(where, 1); })) {
      names.push_back(NameOf(hazard.uuid));
    }
    return names;
  }

  std::uint64_t Announced(const std::string& zone, std::uint8_t number) const {
    return map_.Find(RegionHazardId(zone, IdOf(number)))->announced_sequence;
  }

  RegionMap map_{protocol::HazardCatalogue(), 1000, std::nullopt};
  std::vector<std::string> events_;
  std::vector<std::uint64_t> sequences_;
  std::vector<bool> announced_;
  int subscription_ = 0;
};

TEST_F(RegionMapTest, HasTheHazardsOfAllZonesEachWithASequenceOfItsOwn) {
  map_.Apply("north", {Told(1, 5), Told(2, 6, EastBy(100))});
  map_.Apply("south", {Told(1, 5, EastBy(900))});
  EXPECT_THAT(Listed(), ElementsAre("north 1", "north 2", "south 1"));
  EXPECT_THAT(events_, ElementsAre("0 north 1", "0 north 2", "0 south 1"));
  EXPECT_THAT(sequences_, ElementsAre(1001, 1002, 1003));
  EXPECT_EQ(map_.Sequence(), 1003U);
  EXPECT_EQ(map_.HazardCounts()[static_cast<std::size_t>(zone::HazardState::kActive)], 3U);
  EXPECT_EQ(map_.CountOf("north"), 2U);
  const auto found = map_.Find(RegionHazardId("south", IdOf(1)));
  ASSERT_TRUE(found);
  EXPECT_EQ(map_.WordsOf(*found).street, "Forbes Ave");
}

TEST_F(RegionMapTest, OfACandidateNobodyHearsWhoHearsWhatDriversAreTold) {
  map_.Apply("north", {ToldCandidate(1, 5), Told(2, 6, EastBy(100))});
  EXPECT_THAT(Listed(), ElementsAre("north 1", "north 2"));
  EXPECT_EQ(announced_, (std::vector<bool>{false, true}));
  EXPECT_EQ(Announced("north", 1), 0U);
  EXPECT_EQ(map_.CountOf("north"), 2U);
  EXPECT_EQ(map_.ToldCountOf("north"), 1U);
  map_.Apply("north", {ToldCandidate(1, 7)});
  EXPECT_EQ(events_.back(), "1 north 1");
  // Drivers are told of it: to them it is new.
  map_.Apply("north", {Told(1, 8)});
  EXPECT_EQ(events_.back(), "0 north 1");
  EXPECT_EQ(Announced("north", 1), map_.Sequence());
  EXPECT_EQ(map_.ToldCountOf("north"), 2U);
}

TEST_F(RegionMapTest, AHazardThatIsACandidateAgainIsTakenBackFromDrivers) {
  map_.Apply("north", {Told(1, 5)});
  map_.Apply("north", {ToldCandidate(1, 6)});
  EXPECT_THAT(events_, ElementsAre("0 north 1", "2 north 1", "0 north 1"));
  EXPECT_EQ(announced_, (std::vector<bool>{true, true, false}));
  EXPECT_THAT(Listed({zone::HazardState::kCandidate}), ElementsAre("north 1"));
  EXPECT_EQ(Announced("north", 1), 1002U) << "who asks drivers' hazards hears that it left";
  map_.Apply("north", {ToldGone(1, 7)});
  EXPECT_THAT(Listed(), IsEmpty());
  EXPECT_FALSE(announced_.back());
  EXPECT_EQ(map_.CountOf("north") + map_.ToldCountOf("north"), 0U);
  const auto counts = map_.HazardCounts();
  EXPECT_EQ(counts[static_cast<std::size_t>(zone::HazardState::kCandidate)], 0U);
  EXPECT_EQ(counts[static_cast<std::size_t>(zone::HazardState::kGone)], 1U);
}

TEST_F(RegionMapTest, ACandidateHidesNoHazardAndIsNotHidden) {
  map_.Apply("north", {ToldCandidate(1, 5)});
  map_.Apply("south", {Told(1, 5)});
  EXPECT_THAT(Listed(), ElementsAre("north 1", "south 1"));
  EXPECT_EQ(map_.hidden(), 0U);
  // Confirmed it is the other zone's hazard, which is shown.
  map_.Apply("north", {Told(1, 6)});
  EXPECT_THAT(Listed(), ElementsAre("south 1"));
  EXPECT_EQ(map_.hidden(), 1U);
  EXPECT_EQ(events_.back(), "2 north 1");
  EXPECT_FALSE(announced_.back()) << "drivers never heard of it";
  map_.Remove("south", {IdOf(1)});
  EXPECT_THAT(Listed(), ElementsAre("north 1"));
}

TEST_F(RegionMapTest, KnowsSinceWhenAHazardIsInItsState) {
  map_.Apply("north", {ToldCandidate(1, 5)});
  map_.Apply("north", {ToldCandidate(1, 9)});
  const Uuid id = RegionHazardId("north", IdOf(1));
  EXPECT_EQ(map_.OriginOf(id)->zone_since, 5U);
  EXPECT_EQ(map_.OriginOf(id)->region_since, 1001U);
  map_.Apply("north", {Told(1, 12)});
  EXPECT_EQ(map_.OriginOf(id)->zone_since, 12U);
  EXPECT_EQ(map_.OriginOf(id)->region_since, map_.Sequence());
}

TEST_F(RegionMapTest, AZoneCannotTakeThePlaceOfAnotherOnesHazard) {
  map_.Apply("north", {Told(1, 5)});
  map_.Apply("south", {ToldGone(1, 9)});
  EXPECT_THAT(Listed(), ElementsAre("north 1"));
  EXPECT_NE(RegionHazardId("north", IdOf(1)), RegionHazardId("south", IdOf(1)));
  EXPECT_EQ(RegionHazardId("north", IdOf(1)), RegionHazardId("north", IdOf(1)));
}

TEST_F(RegionMapTest, WhatLeftTheMapIsToldToWhoAsksWhatCameSince) {
  map_.Apply("north", {Told(1, 5), Told(2, 6, EastBy(100))});
  const std::uint64_t before = map_.Sequence();
  map_.Apply("north", {ToldGone(1, 7)});
  EXPECT_THAT(Listed(), ElementsAre("north 2"));
  EXPECT_THAT(Listed({}, before), ElementsAre("north 1"));
  EXPECT_EQ(map_.Find(RegionHazardId("north", IdOf(1)))->state, zone::HazardState::kGone);
  EXPECT_EQ(events_.back(), "2 north 1");
  map_.Apply("north", {Told(1, 8)});
  EXPECT_EQ(events_.back(), "0 north 1");
  EXPECT_THAT(Listed(), ElementsAre("north 2", "north 1"));
}

TEST_F(RegionMapTest, AHazardThatIsToldAgainAsItWasIsNoEvent) {
  map_.Apply("north", {Told(1, 5)});
  map_.Apply("north", {Told(1, 5)});
  EXPECT_THAT(events_, ElementsAre("0 north 1"));
  map_.Apply("north", {Told(1, 6)});
  EXPECT_THAT(events_, ElementsAre("0 north 1", "1 north 1"));
}

TEST_F(RegionMapTest, AHazardOfTwoZonesAtTheirBorderIsThereOnce) {
  map_.Apply("north", {Told(1, 5)});
  map_.Apply("south", {Told(2, 3, EastBy(2)), Told(3, 4, EastBy(50))});
  EXPECT_THAT(Listed(), ElementsAre("north 1", "south 3"));
  EXPECT_EQ(map_.hidden(), 1U);
  EXPECT_EQ(map_.CountOf("south"), 2U);
  map_.Apply("north", {ToldGone(1, 6)});
  EXPECT_THAT(Listed(), ElementsAre("south 3", "south 2"));
  EXPECT_THAT(events_, ElementsAre("0 north 1", "0 south 3", "2 north 1", "0 south 2"));
}

TEST_F(RegionMapTest, AHazardThatIsHiddenFromTheStartIsToldAsGoneToWhoKnowsItFromBefore) {
  map_.Apply("north", {Told(1, 5)});
  const std::uint64_t before = map_.Sequence();
  map_.Apply("south", {Told(2, 3, EastBy(2))});
  EXPECT_THAT(events_, ElementsAre("0 north 1"));
  EXPECT_THAT(Listed({}, before), ElementsAre("south 2"));
  EXPECT_EQ(map_.Find(RegionHazardId("south", IdOf(2)))->state, zone::HazardState::kGone);
}

TEST_F(RegionMapTest, WhatAZoneNoLongerHasCanBeRemoved) {
  map_.Apply("north", {Told(1, 5), Told(2, 6, EastBy(100))});
  map_.Apply("south", {Told(3, 5, EastBy(900))});
  EXPECT_THAT(map_.NotAmong("east", {}), IsEmpty());
  const auto gone = map_.NotAmong("north", {IdOf(2)});
  EXPECT_THAT(gone, ElementsAre(IdOf(1)));
  map_.Remove("north", gone);
  EXPECT_THAT(Listed(), ElementsAre("north 2", "south 3"));
}

TEST_F(RegionMapTest, ClassesThatTheCatalogueDoesNotNameAreUnderItsHeading) {
  RegionMap map(protocol::HazardCatalogue::Parse("classes:\n  debris: {label: Debris}\n", "test"),
                0, std::nullopt);
  map.Apply("north", {Told(1, 5)});
  EXPECT_EQ(map.Find(RegionHazardId("north", IdOf(1)))->class_name, protocol::kOtherClass);
}

}  // namespace
}  // namespace livemap::region
