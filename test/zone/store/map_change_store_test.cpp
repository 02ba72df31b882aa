// Map changes behind ZoneService: what is committed stays, and counts once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "test/zone/map_change_fixture.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

class MapChangeStoreTest : public ZoneTest {
 protected:
  /// All that can be asked of map changes, as text.
  static std::string Everything(const ZoneService& zone) {
    std::string text = std::to_string(zone.Sequence()) + "\n";
    for (const MapChangeFeature& feature : zone.QueryMapChanges(std::nullopt, 1, 1000)) {
      text += feature.uuid.ToString() + " " + feature.class_name + " " +
              MapChangeStateName(feature.state) + " " + std::to_string(feature.vanished) + " " +
              std::to_string(feature.confidence) + " " +
              std::to_string(feature.position.longitude_deg) + " " +
              std::to_string(feature.covariance_m2(0, 0)) + " " + std::to_string(feature.reports) +
              " " + std::to_string(feature.drives) + " " + std::to_string(feature.Vehicles()) +
              " " + std::to_string(feature.Vehicles(true)) + " " +
              std::to_string(feature.first_seen_ns) + " " + std::to_string(feature.last_seen_ns) +
              " " + std::to_string(feature.denied_ns) + " " + std::to_string(feature.sequence) +
              "\n";
      for (const StoredMapChangeEvent& event : zone.MapChangeEvents(feature.uuid, 100)) {
        text += "  " + std::to_string(event.sequence) + " " + MapChangeStateName(event.to) + " " +
                event.reason + "\n";
      }
    }
    return text;
  }
  static protocol::Receipt Tell(ZoneService& zone, const protocol::MapChangeReport& report) {
    return zone.HandleMapChanges({report}).at(0);
  }
  long long Count(const std::string& table) const {
    return static_cast<long long>(Probe().Number("SELECT count(*) FROM " + table));
  }
};

TEST_F(MapChangeStoreTest, ARestartRestoresExactlyTheSameAndGoesOn) {
  std::string before;
  const protocol::MapChangeReport first = MakeMapChange("car-1");
  protocol::MapChangeReport vanished = MakeMapChange("car-3", "drive-9");
  vanished.vanished = true;
  vanished.stamp_ns += kSecondNs;
  {
    ZoneService zone(Config(), Clock(), 1);
    zone.Handle(MakeReport());
    Tell(zone, first);
    Tell(zone, MakeMapChange("car-2"));
    Tell(zone, vanished);
    before = Everything(zone);
    EXPECT_THAT(before, HasSubstr("confirmed told by 2 vehicles"));
    EXPECT_THAT(before, HasSubstr("a vehicle tells the opposite, 2 undo it"));
  }
  ZoneService zone(Config(), Clock(), 2);
  EXPECT_EQ(Everything(zone), before);
  EXPECT_EQ(zone.Sequence(), 4U);
  // The same uuid is answered and counts once; the opposite of another vehicle is the second.
  EXPECT_EQ(Tell(zone, first).status, protocol::Receipt::Status::kCommitted);
  EXPECT_EQ(Everything(zone), before);
  EXPECT_EQ(zone.Statistics().map_changes.repeated, 1U);
  vanished.uuid = MakeMapChange().uuid;
  vanished.vehicle_id = "car-4";
  Tell(zone, vanished);
  EXPECT_EQ(zone.QueryMapChanges(std::nullopt, 1, 10).at(0).state, MapChangeState::kUndone);
  EXPECT_EQ(zone.Sequence(), 5U);
}

TEST_F(MapChangeStoreTest, AReceiptNamesTheFeatureAndAUuidCountsOnceInOneBatch) {
  ZoneService zone(Config(), Clock(), 1);
  const protocol::MapChangeReport report = MakeMapChange();
  protocol::MapChangeReport stolen = report;
  stolen.vehicle_id = "car-2";
  const auto receipts = zone.HandleMapChanges({report, report, stolen});
  ASSERT_EQ(receipts.size(), 3U);
  const auto features = zone.QueryMapChanges(std::nullopt, 0, 10);
  ASSERT_EQ(features.size(), 1U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(receipts[i].status, protocol::Receipt::Status::kCommitted);
    EXPECT_EQ(receipts[i].report_uuid, report.uuid);
    EXPECT_EQ(receipts[i].hazard_uuid, features[0].uuid);
    EXPECT_EQ(receipts[i].vehicle_id, "car-1");
  }
  EXPECT_EQ(receipts[2].status, protocol::Receipt::Status::kRefused);
  EXPECT_THAT(Tell(zone, stolen).reason, HasSubstr("another vehicle's"));
  EXPECT_EQ(features[0].reports, 1U);
}

TEST_F(MapChangeStoreTest, WhatIsRefusedLeavesNothing) {
  ZoneService zone(Config(), Clock(), 1);
  protocol::MapChangeReport report = MakeMapChange();
  report.class_name = "'); DROP TABLE map_changes; --";
  const protocol::Receipt receipt = Tell(zone, report);
  EXPECT_EQ(receipt.status, protocol::Receipt::Status::kRefused);
  EXPECT_THAT(receipt.reason, HasSubstr("accepted is barrier"));
  EXPECT_TRUE(receipt.hazard_uuid.IsNil());
  EXPECT_EQ(zone.Sequence(), 0U);
  EXPECT_EQ(Count("map_change_reports"), 0);
  EXPECT_EQ(zone.Statistics().map_changes.refused, 1U);
}

TEST_F(MapChangeStoreTest, BeyondItsHourlyCapAVehicleIsNotAnsweredNow) {
  ZoneService::Config config = Config();
  config.map_changes_per_hour = 2;
  std::int64_t now_ns = kNowNs;
  ZoneService zone(
      config, [&] { return now_ns; }, 1);
  const protocol::MapChangeReport third = MakeMapChange("car-1", "drive-3");
  EXPECT_EQ(zone.HandleMapChanges(
                    {MakeMapChange("car-1", "drive-1"), MakeMapChange("car-1", "drive-2"), third})
                .size(),
            2U);
  EXPECT_EQ(zone.Statistics().map_changes.not_now, 1U);
  EXPECT_EQ(zone.HandleMapChanges({MakeMapChange("car-2")}).size(), 1U);
  now_ns += 1800 * kSecondNs;
  EXPECT_EQ(zone.HandleMapChanges({third}).size(), 1U);
}

TEST_F(MapChangeStoreTest, AFailedCommitLeavesMemoryAndStoreAsTheyWere) {
  ZoneService zone(Config(), Clock(), 1);
  const Uuid uuid = Tell(zone, MakeMapChange("car-1")).hazard_uuid;
  const std::string before = Everything(zone);
  StoreProbe saboteur = Probe();
  saboteur.Refuse("INSERT", "map_change_events", "full");
  EXPECT_THROW(zone.HandleMapChanges({MakeMapChange("car-2")}), StoreError);
  EXPECT_THROW(zone.DismissMapChange(uuid, "Anna", "a shadow"), StoreError);
  EXPECT_EQ(Everything(zone), before);
  saboteur.Accept("map_change_events");
  Tell(zone, MakeMapChange("car-2"));
  EXPECT_EQ(zone.FindMapChange(uuid)->state, MapChangeState::kConfirmed);
}

TEST_F(MapChangeStoreTest, OfficialsDecideAndTheHistorySaysWho) {
  ZoneService zone(Config(), Clock(), 1);
  const Uuid uuid = Tell(zone, MakeMapChange()).hazard_uuid;
  EXPECT_TRUE(zone.DismissMapChange(uuid, "Anna", "a shadow"));
  EXPECT_TRUE(zone.DismissMapChange(uuid, "Anna", "a shadow")) << "the same again is no event";
  EXPECT_TRUE(zone.QueryMapChanges(std::nullopt, 0, 10).empty());
  EXPECT_TRUE(zone.ConfirmMapChange(uuid, "Bert"));
  const auto events = zone.MapChangeEvents(uuid, 10);
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(events[1].reason, "dismissed by Anna: a shadow");
  EXPECT_EQ(events[2].reason, "confirmed by Bert");
  EXPECT_EQ(events[2].from, MapChangeState::kDismissed);
  EXPECT_EQ(zone.MapChangeEvents(uuid, 1).size(), 1U);
  EXPECT_FALSE(zone.ConfirmMapChange(Uuid{}, "Bert"));
  EXPECT_THROW(zone.ConfirmMapChange(uuid, "Be\nrt"), Error);
}

TEST_F(MapChangeStoreTest, EventsReachSubscribersInOneOrderWithThoseOfHazards) {
  ZoneService zone(Config(), Clock(), 1);
  std::vector<std::uint64_t> sequences;
  std::vector<HazardAction> actions;
  const int id = zone.Subscribe([&](const ZoneEvent& event) {
    if (event.hazard) sequences.push_back(event.hazard->hazard.sequence);
    if (!event.map_change) return;
    sequences.push_back(event.map_change->feature.sequence);
    actions.push_back(event.map_change->Action());
  });
  const Uuid uuid = Tell(zone, MakeMapChange("car-1")).hazard_uuid;
  zone.Handle(MakeReport());
  Tell(zone, MakeMapChange("car-2"));
  zone.DismissMapChange(uuid, "Anna", "why");
  zone.Unsubscribe(id);
  EXPECT_EQ(sequences, (std::vector<std::uint64_t>{1, 2, 3, 4}));
  EXPECT_EQ(actions, (std::vector<HazardAction>{HazardAction::kAdded, HazardAction::kUpdated,
                                                HazardAction::kRemoved}));
}

TEST_F(MapChangeStoreTest, AVehicleThatAnOfficialDistrustsCannotConfirm) {
  ZoneService zone(Config(), Clock(), 1);
  protocol::Report report = MakeReport();
  report.vehicle_id = "liar";
  zone.Handle(report);
  ASSERT_TRUE(zone.Distrust("liar", "Anna", "stolen"));
  const Uuid uuid = Tell(zone, MakeMapChange("car-1")).hazard_uuid;
  EXPECT_EQ(Tell(zone, MakeMapChange("liar")).hazard_uuid, uuid);
  EXPECT_EQ(zone.FindMapChange(uuid)->state, MapChangeState::kProposed);
  EXPECT_EQ(zone.Statistics().map_changes.known, 1U);
}

TEST_F(MapChangeStoreTest, BeyondTheMaximumTheOldestClosedOneLeavesTheStoreToo) {
  ZoneService::Config config = Config();
  config.map_changes.max_features = 1;
  ZoneService zone(config, Clock(), 1);
  const protocol::MapChangeReport first = MakeMapChange();
  const Uuid uuid = Tell(zone, first).hazard_uuid;
  protocol::MapChangeReport second = MakeMapChange();
  second.class_name = "sign";
  EXPECT_THAT(Tell(zone, second).reason, HasSubstr("maximum of 1 map changes"));
  zone.DismissMapChange(uuid, "Anna", "a shadow");
  EXPECT_EQ(Tell(zone, second).status, protocol::Receipt::Status::kCommitted);
  EXPECT_FALSE(zone.FindMapChange(uuid));
  EXPECT_EQ(Count("map_changes"), 1);
  EXPECT_EQ(Count("map_change_events"), 1);
  EXPECT_EQ(Tell(zone, first).hazard_uuid, uuid) << "what was committed stays committed";
}

TEST_F(MapChangeStoreTest, AStoreOfVersion3IsBroughtUpToDate) {
  SKIP_ON_POSTGRESQL();
  Uuid hazard;
  {
    ZoneService zone(Config(), Clock(), 1);
    hazard = zone.Handle(MakeReport()).hazard_uuid;
  }
  Probe().Execute(
      std::string(kLastReportsTable) +
      "INSERT INTO last_reports SELECT vehicle_id, stamp_ns, 1.5, longitude, sigma_m FROM places; "
      "DROP TABLE places; DROP TABLE map_changes; DROP TABLE map_change_reports; "
      "DROP TABLE map_change_events; DELETE FROM livemap_schema WHERE version >= 4");
  ZoneService zone(Config(), Clock(), 2);
  EXPECT_TRUE(zone.Find(hazard));
  EXPECT_EQ(Probe().Text("SELECT latitude FROM places"), "1.5") << "where the vehicle was last";
  EXPECT_EQ(Tell(zone, MakeMapChange()).status, protocol::Receipt::Status::kCommitted);
  EXPECT_EQ(zone.Sequence(), 2U);
}

TEST_F(MapChangeStoreTest, RowsOfImpossibleValuesAreLeftOutAndToldTheOthersStay) {
  std::vector<std::string> values{"state = 9",           "class_name = 'no_change'",
                                  "latitude = 91",       "covariance_ee = 0",
                                  "witnesses = '1 2 3'", "uuid = 'x'",
                                  "reports = -1",        "drives = 2000",
                                  "sequence = -4",       "last_seen_ns = -1",
                                  "confidence = 2"};
  // Columns of SQLite take values of any type.
  const std::vector<std::string> more =
      IsOnPostgresql()
          ? std::vector<std::string>{"longitude = 'NaN'", "covariance_nn = '-Infinity'",
                                     "witnesses = repeat('1 ', 100000)"}
          : std::vector<std::string>{"confidence = 'high'", "updated_ns = 9e999",
                                     "witnesses = zeroblob(100000)"};
  values.insert(values.end(), more.begin(), more.end());
  const std::size_t broken = values.size();
  {
    ZoneService zone(Config(), Clock(), 1);
    for (std::size_t i = 0; i <= broken; ++i) {
      protocol::MapChangeReport report = MakeMapChange();
      report.position = EastOf(100.0 * static_cast<double>(i));
      Tell(zone, report);
    }
  }
  {
    StoreProbe database = Probe();
    for (std::size_t i = 0; i < broken; ++i) {
      database.Execute("UPDATE map_changes SET " + values[i] +
                       " WHERE id = " + std::to_string(i + 1));
    }
  }
  ZoneService zone(Config(), Clock(), 2);
  EXPECT_EQ(zone.QueryMapChanges(std::nullopt, 0, 100).size(), 1U);
  EXPECT_EQ(zone.Statistics().store_damage.rows, broken);
  EXPECT_EQ(Tell(zone, MakeMapChange("car-7")).status, protocol::Receipt::Status::kCommitted);
  EXPECT_EQ(Count("map_changes"), static_cast<long long>(broken) + 2) << "broken rows stay";
}

}  // namespace
}  // namespace livemap::zone
