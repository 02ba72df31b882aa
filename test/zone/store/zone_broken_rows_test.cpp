// A sound database into which something else wrote impossible values, and what is kept of vehicles.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

using ::testing::HasSubstr;

class ZoneBrokenRowsTest : public ZoneTest {
 protected:
  /// Three hazards; returns the uuid of each.
  std::vector<Uuid> MakeHazards() {
    ZoneService zone(Config(), Clock(), 1);
    std::vector<Uuid> hazards;
    for (int i = 1; i <= 3; ++i) {
      reports_.push_back(MakeReport({double(i), 1}));
      hazards.push_back(zone.Handle(reports_.back()).hazard_uuid);
    }
    return hazards;
  }
  void Write(const std::string& sql) { Probe().Execute(sql); }
  /// For all databases, and for the one at hand: columns of SQLite take values of any type.
  static std::vector<std::string> BrokenHazards() {
    std::vector<std::string> broken{"latitude = 91",
                                    "covariance_ee = -1",
                                    "covariance_en = 5",
                                    "covariance_nn = 1e300",
                                    "confidence = 1.5",
                                    "presence = -1",
                                    "class_name = ''",
                                    "uuid = 'x'",
                                    "sightings = 0",
                                    "sightings = 4294967296",
                                    "first_seen_ns = -1",
                                    "last_seen_ns = 9223372036854775807",
                                    "sequence = 9223372036854775807",
                                    "announced_sequence = 99",
                                    "state = 7",
                                    "state = 2",
                                    "life = '1 2 3'",
                                    "image_sha256 = '../../etc/passwd'",
                                    "vehicles = -1"};
    const std::vector<std::string> more =
        IsOnPostgresql() ? std::vector<std::string>{"latitude = 'Infinity'",
                                                    "longitude = 'NaN'",
                                                    "covariance_ee = '-Infinity'",
                                                    "class_name = repeat('x', 100000)",
                                                    "class_name = E'\\x01'",
                                                    "life = repeat('1 ', 100000)"}
                         : std::vector<std::string>{"latitude = 9e999", "longitude = 'x'",
                                                    "class_name = printf('%100000s', 'x')",
                                                    "class_name = x'ff'", "life = x'00'"};
    broken.insert(broken.end(), more.begin(), more.end());
    return broken;
  }

  std::vector<protocol::Report> reports_;
};

TEST_F(ZoneBrokenRowsTest, ABrokenHazardIsLeftOutAndCountedAndTheOthersStay) {
  for (const std::string& broken : BrokenHazards()) {
    EmptyStore();
    reports_.clear();
    const std::vector<Uuid> hazards = MakeHazards();
    Write("UPDATE hazards SET " + broken + " WHERE id = 2");
    ZoneService zone(Config(), Clock(), 2);
    EXPECT_TRUE(zone.Find(hazards[0])) << broken;
    EXPECT_FALSE(zone.Find(hazards[1])) << broken;
    EXPECT_TRUE(zone.Find(hazards[2])) << broken;
    EXPECT_EQ(zone.Statistics().store_damage.rows, 1U) << broken;
    EXPECT_THAT(zone.Statistics().store_damage.first, HasSubstr("hazard")) << broken;
    // Its report is known all the same, and a new hazard does not write over its row.
    EXPECT_EQ(zone.Handle(reports_[1]).status, protocol::Receipt::Status::kCommitted) << broken;
    EXPECT_EQ(zone.Statistics().repeated, 1U) << broken;
    EXPECT_EQ(zone.Handle(MakeReport({50, 1})).status, protocol::Receipt::Status::kCommitted)
        << broken;
  }
}

TEST_F(ZoneBrokenRowsTest, TheNewestRowsMayBeTheBrokenOnes) {
  const std::vector<Uuid> hazards = MakeHazards();
  Write("UPDATE hazards SET latitude = 100 WHERE id = 3; DELETE FROM events WHERE sequence > 1");
  ZoneService zone(Config(), Clock(), 2);
  EXPECT_EQ(zone.Sequence(), 2U);
  zone.Handle(MakeReport({50, 1}));
  EXPECT_EQ(Probe().Number("SELECT latitude FROM hazards WHERE id = 3"), 100)
      << "what was there is there";
}

TEST_F(ZoneBrokenRowsTest, BrokenEventsLivesTrustAndPlacesAreLeftOut) {
  const std::vector<Uuid> hazards = MakeHazards();
  const std::string infinity = IsOnPostgresql() ? "'Infinity'" : "9e999";
  Write(
      "UPDATE events SET to_state = 9 WHERE sequence = 1;"
      "UPDATE places SET latitude = " +
      infinity +
      ";"
      "INSERT INTO lives VALUES ('pothole', -1, 1), ('deer', " +
      infinity +
      ", 0);"
      "INSERT INTO trust VALUES (1, -1, 0, ''), (2, 1, 0, 'x'), (3, 1, -5, '0 0 0 0 0 0 0 0 0')");
  ZoneService zone(Config(), Clock(), 2);
  EXPECT_TRUE(zone.Events(hazards[0], 10).empty());
  EXPECT_EQ(zone.Events(hazards[1], 10).size(), 1U);
  EXPECT_EQ(zone.Statistics().store_damage.rows, 6U);
  EXPECT_EQ(zone.Handle(MakeReport({50, 1})).status, protocol::Receipt::Status::kCommitted);
}

TEST_F(ZoneBrokenRowsTest, ASchemaThatNoProgramWroteIsRefused) {
  MakeHazards();
  Write("DELETE FROM livemap_schema; INSERT INTO livemap_schema VALUES (-7)");
  EXPECT_THROW(ZoneService(Config(), Clock(), 2), StoreError);
}

TEST_F(ZoneBrokenRowsTest, WhatIsHeldAgainstVehiclesOutlivesARestartAndOldSchemas) {
  SKIP_ON_POSTGRESQL();
  ZoneService::Config config = Config();
  config.catalogue = protocol::HazardCatalogue();
  const auto invent = [&](ZoneService& zone, double latitude_deg) {
    protocol::Report report = MakeReport({latitude_deg, 1});
    report.vehicle_id = "liar";
    zone.Reject(zone.Handle(report).hazard_uuid, "Anna", "nothing there");
  };
  {
    ZoneService zone(config, Clock(), 1);
    invent(zone, 1);
  }
  // As version 2 wrote it.
  Write(std::string(kLastReportsTable) +
        "DROP TABLE trust; DROP TABLE map_changes; DROP TABLE map_change_reports; "
        "DROP TABLE map_change_events; DELETE FROM livemap_schema WHERE version >= 3");
  {
    ZoneService zone(config, Clock(), 2);
    EXPECT_EQ(zone.Statistics().suspect_vehicles, 0U);
    invent(zone, 2);
    invent(zone, 3);
    EXPECT_EQ(zone.Statistics().suspect_vehicles, 1U);
  }
  ZoneService zone(config, Clock(), 3);
  EXPECT_EQ(zone.Statistics().suspect_vehicles, 1U);
  protocol::Report report = MakeReport({10, 1});
  report.vehicle_id = "liar";
  const Uuid hazard = zone.Handle(report).hazard_uuid;
  EXPECT_EQ(zone.Find(hazard)->vehicles, 0U);
  report = MakeReport({10, 1});
  zone.Handle(report);
  EXPECT_EQ(zone.Find(hazard)->state, HazardState::kCandidate) << "one vehicle that counts";
  report = MakeReport({10, 1});
  report.vehicle_id = "car-2";
  zone.Handle(report);
  EXPECT_EQ(zone.Find(hazard)->state, HazardState::kActive);
}

TEST_F(ZoneBrokenRowsTest, AFailedRejectionIsHeldAgainstNobody) {
  ZoneService zone(Config(), Clock(), 1);
  const Uuid hazard = zone.Handle(MakeReport({1, 1})).hazard_uuid;
  Probe().Refuse("INSERT", "trust", "full");
  for (int i = 0; i < 5; ++i) EXPECT_THROW(zone.Reject(hazard, "Anna", ""), StoreError);
  EXPECT_EQ(zone.Statistics().suspect_vehicles, 0U);
}

}  // namespace
}  // namespace livemap::zone
