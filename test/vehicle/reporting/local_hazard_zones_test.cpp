// A vehicle that changes zones: what one zone says touches nothing of another one.
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <string>

#include "test/support/temporary_directory.h"
#include "test/vehicle/reporting/known_reports.h"
#include "vehicle/reporting/local_hazard_map.h"

namespace livemap::vehicle {
namespace {

using Action = protocol::Notice::Action;

protocol::Notice OfZone(const std::string& zone, Action action, int hazard, double east_m,
                        std::uint64_t previous, std::uint64_t sequence) {
  protocol::Notice notice = MakeNotice(action, hazard, East(east_m), sequence);
  notice.previous_sequence = previous;
  notice.zone = zone;
  return notice;
}

protocol::Notice AllTold(const std::string& zone, std::uint64_t sequence, std::uint32_t told) {
  protocol::Notice notice;
  notice.action = Action::kCaughtUp;
  notice.vehicle_id = "car-1";
  notice.sequence = sequence;
  notice.told = told;
  notice.position = kStreet;
  notice.radius_m = 1000;
  notice.zone = zone;
  return notice;
}

protocol::Receipt CommittedBy(const std::string& zone, int report, int hazard) {
  protocol::Receipt receipt;
  receipt.status = protocol::Receipt::Status::kCommitted;
  receipt.report_uuid = Id(report);
  receipt.hazard_uuid = Id(hazard);
  receipt.zone = zone;
  return receipt;
}

class LocalHazardZones : public ::testing::Test {
 protected:
  LocalHazardZones() {
    config_.path = directory_.path() + "/local.sqlite3";
    config_.zone = "west";
    Restart();
  }
  void Restart() {
    map_.reset();
    map_ = std::make_unique<LocalHazardMap>(config_, protocol::HazardCatalogue(), kNowNs);
  }
  std::map<Uuid, std::string> ZonesOfKnown() const {
    std::map<Uuid, std::string> zones;
    for (const KnownHazard& hazard : map_->Known(1000)) zones[hazard.id] = hazard.zone;
    return zones;
  }

  test::TemporaryDirectory directory_;
  LocalHazardMap::Config config_;
  std::unique_ptr<LocalHazardMap> map_;
};

TEST_F(LocalHazardZones, EachZoneCountsItsAnnouncementsForItselfAlsoOverARestart) {
  map_->Apply(
      {OfZone("west", Action::kAdded, 1, 0, 0, 500), OfZone("east", Action::kAdded, 2, 200, 0, 3)});
  EXPECT_FALSE(map_->has_gap()) << "3 after 500 is of another zone";
  map_->Apply({OfZone("east", Action::kAdded, 3, 250, 3, 4)});
  Restart();
  EXPECT_EQ(map_->map_sequence("west"), 500U);
  EXPECT_EQ(map_->map_sequence("east"), 4U);
  EXPECT_EQ(map_->map_sequence("north"), 0U);
  EXPECT_EQ(map_->map_sequence(), 500U) << "of the configured zone";
  EXPECT_EQ(ZonesOfKnown(),
            (std::map<Uuid, std::string>{{Id(1), "west"}, {Id(2), "east"}, {Id(3), "east"}}));
}

TEST_F(LocalHazardZones, AGapOfOneZoneHoldsUpNoOtherZone) {
  map_->Apply(
      {OfZone("west", Action::kAdded, 1, 0, 0, 1), OfZone("west", Action::kAdded, 2, 50, 8, 9),
       OfZone("east", Action::kAdded, 3, 200, 0, 1), OfZone("east", Action::kAdded, 4, 250, 1, 2)});
  EXPECT_TRUE(map_->has_gap());
  EXPECT_EQ(map_->map_sequence("west"), 1U);
  EXPECT_EQ(map_->map_sequence("east"), 2U);
}

TEST_F(LocalHazardZones, NoZoneMovesOrRemovesAHazardOfAnother) {
  map_->Apply({OfZone("west", Action::kAdded, 1, 0, 0, 1)});
  EXPECT_EQ(map_->Apply({OfZone("east", Action::kUpdated, 1, 300, 0, 70),
                         OfZone("east", Action::kRemoved, 1, 0, 70, 71)}),
            2U);
  EXPECT_TRUE(map_->Find("pothole", kStreet));
  // They came, all the same: east need not tell them again.
  EXPECT_EQ(map_->map_sequence("east"), 71U);
}

TEST_F(LocalHazardZones, WhatAZoneAnnouncesInAnothersAreaIsLeftOutAndCountedAndHoldsUpNothing) {
  // East of 1000 m everything is none of west's business.
  const double border_deg = East(1000).longitude_deg;
  map_->RefuseBeyond([border_deg](const std::string& zone, const geo::GeoPoint& place) {
    return zone == "west" && place.longitude_deg > border_deg;
  });
  EXPECT_EQ(map_->Apply({OfZone("west", Action::kAdded, 1, 900, 0, 1),
                         OfZone("west", Action::kAdded, 2, 1100, 1, 2),
                         OfZone("east", Action::kAdded, 3, 1200, 0, 1),
                         // Its own hazard, moved over the border.
                         OfZone("west", Action::kUpdated, 1, 1100, 2, 3)}),
            2U);
  EXPECT_EQ(map_->beyond_zone(), 2U);
  EXPECT_EQ(ZonesOfKnown(), (std::map<Uuid, std::string>{{Id(1), "west"}, {Id(3), "east"}}));
  EXPECT_TRUE(map_->Find("pothole", East(900))) << "it stays where it was";
  EXPECT_FALSE(map_->Find("pothole", East(1100)));
  EXPECT_FALSE(map_->has_gap());
  EXPECT_EQ(map_->map_sequence("west"), 3U) << "west need not tell it again";
  // What it takes back is taken back wherever that lies.
  map_->Apply({OfZone("west", Action::kRemoved, 1, 1100, 3, 4)});
  EXPECT_EQ(ZonesOfKnown(), (std::map<Uuid, std::string>{{Id(3), "east"}}));
  EXPECT_EQ(map_->beyond_zone(), 2U);
}

TEST_F(LocalHazardZones, ATellingOfAllTakesAwayWhatItsOwnZoneNoLongerHas) {
  map_->Apply({OfZone("west", Action::kAdded, 1, 0, 0, 1),
               OfZone("west", Action::kAdded, 2, 100, 1, 2),
               OfZone("east", Action::kAdded, 3, 200, 0, 1)});
  protocol::Notice told = OfZone("west", Action::kAdded, 1, 0, 0, 1);
  told.vehicle_id = "car-1";
  EXPECT_EQ(map_->Apply({told, AllTold("west", 5, 1)}), 0U);
  EXPECT_EQ(ZonesOfKnown(), (std::map<Uuid, std::string>{{Id(1), "west"}, {Id(3), "east"}}));
}

TEST_F(LocalHazardZones, WhatOneZoneToldDoesNotCompleteTheTellingOfAnother) {
  protocol::Notice told = OfZone("west", Action::kAdded, 1, 0, 0, 1);
  told.vehicle_id = "car-1";
  EXPECT_EQ(map_->Apply({told, AllTold("east", 5, 1)}), 1U);
  EXPECT_EQ(map_->map_sequence("east"), 0U);
}

TEST_F(LocalHazardZones, AReportWaitsForTheReceiptOfItsOwnZone) {
  protocol::Report report = MakeReport(1, kStreet);
  report.zone = "east";
  map_->Add(report);
  EXPECT_FALSE(map_->Apply(CommittedBy("west", 1, 9)));
  EXPECT_FALSE(map_->Apply(CommittedBy("", 1, 9))) << "of the configured zone";
  Restart();
  ASSERT_TRUE(map_->LoadPending(Id(1)));
  EXPECT_EQ(map_->LoadPending(Id(1))->zone, "east");
  EXPECT_TRUE(map_->Apply(CommittedBy("east", 1, 9)));
  EXPECT_EQ(map_->pending_count(), 0U);
  EXPECT_EQ(ZonesOfKnown(), (std::map<Uuid, std::string>{{Id(9), "east"}}));
}

TEST_F(LocalHazardZones, WhatAnOlderProgramLeftBelongsToTheConfiguredZone) {
  map_->Add(MakeReport(1, kStreet));
  map_->Apply({OfZone("west", Action::kAdded, 2, 100, 0, 4),
               OfZone("west", Action::kRemoved, 3, 200, 4, 5)});
  map_.reset();
  MakeOlder(config_.path);
  config_.zone = "north";
  Restart();
  EXPECT_EQ(map_->LoadPending(Id(1))->zone, "north");
  EXPECT_EQ(map_->map_sequence("north"), 5U);
  EXPECT_EQ(ZonesOfKnown(), (std::map<Uuid, std::string>{{Id(1), "north"}, {Id(2), "north"}}));
  map_->Apply({OfZone("north", Action::kAdded, 3, 200, 0, 4)});
  EXPECT_FALSE(map_->Find("pothole", East(200))) << "its removal is remembered";
  config_.zone = "south";
  Restart();
  EXPECT_EQ(map_->LoadPending(Id(1))->zone, "north") << "a row keeps its zone";
}

TEST_F(LocalHazardZones, WithoutADirectoryAnyMoreTheOneZoneTakesWhatWaitsAndTellsItsHazardsAgain) {
  protocol::Report report = MakeReport(1, kStreet);
  report.zone = "east";
  map_->Add(report);
  map_->Apply({OfZone("west", Action::kAdded, 2, 100, 0, 400)});
  config_.zone.clear();
  Restart();
  EXPECT_EQ(map_->LoadPending(Id(1))->zone, "");
  EXPECT_EQ(map_->map_sequence(), 0U) << "of a zone that counts for itself";
  EXPECT_EQ(map_->Apply({OfZone("city", Action::kUpdated, 2, 120, 0, 7)}), 0U);
  EXPECT_TRUE(map_->Find("pothole", East(120)));
  EXPECT_TRUE(map_->Apply(CommittedBy("city", 1, 9)));
  EXPECT_EQ(map_->pending_count(), 0U);
}

TEST_F(LocalHazardZones, AReportIsGivenToAnotherZoneWithWhatIsKnownOfItsHazard) {
  protocol::Report report = MakeReport(1, kStreet);
  report.zone = "east";
  map_->Add(report);
  map_->GiveZone(Id(1), "north");
  Restart();
  EXPECT_EQ(map_->LoadPending(Id(1))->zone, "north");
  EXPECT_EQ(ZonesOfKnown(), (std::map<Uuid, std::string>{{Id(1), "north"}}));
  EXPECT_FALSE(map_->Apply(CommittedBy("east", 1, 9)));
}

TEST_F(LocalHazardZones, HazardsOfAZoneThatIsGoneAreForgottenAndOwnReportsStay) {
  protocol::Report report = MakeReport(1, kStreet);
  report.zone = "east";
  map_->Add(report);
  map_->Apply({OfZone("west", Action::kAdded, 2, 100, 0, 1),
               OfZone("east", Action::kAdded, 3, 200, 0, 4),
               OfZone("north", Action::kAdded, 4, 300, 0, 8)});
  map_->ForgetZones([](const std::string& zone) { return zone != "north"; });
  EXPECT_EQ(ZonesOfKnown(),
            (std::map<Uuid, std::string>{{Id(1), "east"}, {Id(2), "west"}, {Id(4), "north"}}))
      << "west is configured";
  EXPECT_FALSE(map_->Find("pothole", East(200)));
  EXPECT_EQ(map_->map_sequence("east"), 0U) << "if it comes back, it tells all";
  EXPECT_EQ(map_->pending_count(), 1U);
}

TEST_F(LocalHazardZones, WithoutAConfiguredZoneThereIsOneWhateverItsId) {
  config_.path += "-one";
  config_.zone.clear();
  Restart();
  map_->Add(MakeReport(1, kStreet));
  map_->Apply({OfZone("west", Action::kAdded, 2, 100, 0, 4)});
  EXPECT_EQ(map_->map_sequence(), 4U);
  EXPECT_TRUE(map_->Apply(CommittedBy("west", 1, 9)));
}

}  // namespace
}  // namespace livemap::vehicle
