#include "zone/store/zone_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "common/sqlite.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

class ZoneStoreTest : public ZoneTest {
 protected:
  /// All that can be asked of the zone, as text.
  static std::string Everything(const ZoneService& zone) {
    std::string text =
        std::to_string(zone.Sequence()) + " " + std::to_string(zone.AnnouncedSequence()) + "\n";
    for (const Hazard& hazard : zone.Query(std::nullopt, 1, 100000)) {
      text += hazard.uuid.ToString() + " " + std::to_string(hazard.sequence) + " " +
              HazardStateName(hazard.state) + " " + std::to_string(hazard.presence) + " " +
              std::to_string(hazard.vehicles) + " " + std::to_string(hazard.sightings) + "\n";
      for (const StoredEvent& event : zone.Events(hazard.uuid, 100)) {
        text += "  " + std::to_string(event.sequence) + " " + event.reason + "\n";
      }
    }
    return text;
  }
};

/// No file may grow beyond its size now and `bytes`, while this object lives: a full disk.
class FullDisk {
 public:
  FullDisk(const std::string& path, std::uintmax_t bytes) {
    previous_ = std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &limit_);
    rlimit small = limit_;
    small.rlim_cur = std::filesystem::file_size(path) + bytes;
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &limit_);
    std::signal(SIGXFSZ, previous_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit limit_{};
  void (*previous_)(int) = nullptr;
};

TEST_F(ZoneStoreTest, AFullDiskRefusesNewWorkAndDamagesNothingAccepted) {
  SKIP_ON_POSTGRESQL();
  std::vector<protocol::Report> reports;
  for (int i = 0; i < 400; ++i) reports.push_back(MakeReport({40 + 0.001 * i, 8}));
  std::string before;
  {
    ZoneService zone(Config(), Clock(), 1);
    const Uuid known = zone.Handle(MakeReport({1, 1})).hazard_uuid;
    before = Everything(zone);
    {
      const FullDisk full(DatabasePath() + "-wal", 8192);
      EXPECT_THROW(zone.HandleBatch(reports), StoreError);
      EXPECT_EQ(Everything(zone), before);
      EXPECT_THROW(zone.HandleBatch(reports), StoreError);
      EXPECT_EQ(zone.Statistics().store_errors, 2U);
      EXPECT_EQ(zone.Statistics().added, 1U);
      EXPECT_TRUE(zone.Find(known));
    }
    // With room again the same work is taken, without a restart.
    for (const protocol::Receipt& receipt : zone.HandleBatch(reports)) {
      EXPECT_EQ(receipt.status, protocol::Receipt::Status::kCommitted);
    }
    before = Everything(zone);
  }
  const ZoneService zone(Config(), Clock(), 2);
  EXPECT_EQ(Everything(zone), before);
  EXPECT_EQ(zone.Query(std::nullopt, 0, 1000).size(), 401U);
}

TEST_F(ZoneStoreTest, AFailedDecisionLeavesMemoryAndStoreAsTheyWere) {
  ZoneService::Config config = Config();
  std::int64_t now_ns = kNowNs;
  ZoneService zone(
      config, [&] { return now_ns; }, 1);
  const Uuid hazard = zone.Handle(MakeReport({1, 1})).hazard_uuid;
  const std::string before = Everything(zone);
  StoreProbe saboteur = Probe();
  saboteur.Refuse("UPDATE", "hazards", "full");
  EXPECT_THROW(zone.Reject(hazard, "Anna", "why"), StoreError);
  EXPECT_THROW(zone.Confirm(hazard, "Anna"), StoreError);
  EXPECT_THROW(zone.Distrust("car-1", "Anna", "why"), StoreError);
  EXPECT_EQ(zone.Statistics().suspect_vehicles, 0U);
  EXPECT_THROW(zone.Remove(hazard, "why"), StoreError);
  now_ns += 400 * 86400'000'000'000;
  EXPECT_THROW(zone.Advance(), StoreError);
  EXPECT_EQ(Everything(zone), before);
  saboteur.Accept("hazards");
  // What was due is due still.
  zone.Advance();
  EXPECT_FALSE(IsOnMap(zone.Find(hazard)->state));
  EXPECT_EQ(zone.Sequence(), 2U);
}

TEST_F(ZoneStoreTest, WhatWasLearnedOfAClassIsCommittedWithTheReportOrForgotten) {
  std::int64_t now_ns = kNowNs;
  ZoneService zone(
      Config(), [&] { return now_ns; }, 1);
  const auto learned = [this] {
    return Probe().Number("SELECT coalesce(sum(stood_s), 0) FROM lives");
  };
  zone.Handle(MakeReport({1, 1}));
  const auto sighting = [&](const std::string& vehicle) {
    protocol::Report report = MakeReport({1, 1});
    report.vehicle_id = vehicle;
    report.stamp_ns = now_ns;
    return report;
  };
  now_ns += 1000'000'000'000;
  zone.Handle(sighting("car-2"));
  const double before_s = learned();
  EXPECT_NEAR(before_s, 1000, 2);
  StoreProbe saboteur = Probe();
  saboteur.Refuse("INSERT", "events", "full");
  now_ns += 1000'000'000'000;
  for (int i = 0; i < 3; ++i) EXPECT_THROW(zone.Handle(sighting("car-3")), StoreError);
  saboteur.Accept("events");
  EXPECT_EQ(learned(), before_s);
  zone.Handle(sighting("car-3"));
  EXPECT_NEAR(learned(), 2000, 3);
}

/// A database as the first release wrote it: a hazard with two sightings, one that was removed.
constexpr char kVersion1[] = R"(
  CREATE TABLE livemap_schema (version INTEGER NOT NULL);
  CREATE TABLE hazards (uuid VARCHAR(36) PRIMARY KEY, class_name TEXT NOT NULL,
    confidence DOUBLE PRECISION NOT NULL, latitude DOUBLE PRECISION NOT NULL,
    longitude DOUBLE PRECISION NOT NULL, covariance_ee DOUBLE PRECISION NOT NULL,
    covariance_en DOUBLE PRECISION NOT NULL, covariance_nn DOUBLE PRECISION NOT NULL,
    sightings BIGINT NOT NULL, first_seen_ns BIGINT NOT NULL, last_seen_ns BIGINT NOT NULL,
    updated_ns BIGINT NOT NULL, sequence BIGINT NOT NULL UNIQUE,
    image_sha256 VARCHAR(64) NOT NULL, image_format VARCHAR(8) NOT NULL, active INTEGER NOT NULL);
  CREATE TABLE reports (uuid VARCHAR(36) PRIMARY KEY,
    hazard_uuid VARCHAR(36) NOT NULL REFERENCES hazards (uuid), vehicle_id TEXT NOT NULL,
    drive_id TEXT NOT NULL, stamp_ns BIGINT NOT NULL, received_ns BIGINT NOT NULL,
    confidence DOUBLE PRECISION NOT NULL, latitude DOUBLE PRECISION NOT NULL,
    longitude DOUBLE PRECISION NOT NULL, covariance_ee DOUBLE PRECISION NOT NULL,
    covariance_en DOUBLE PRECISION NOT NULL, covariance_nn DOUBLE PRECISION NOT NULL,
    image_sha256 VARCHAR(64) NOT NULL);
  CREATE INDEX reports_by_hazard ON reports (hazard_uuid);
  CREATE TABLE events (sequence BIGINT PRIMARY KEY,
    hazard_uuid VARCHAR(36) NOT NULL REFERENCES hazards (uuid), action INTEGER NOT NULL,
    reason TEXT NOT NULL, at_ns BIGINT NOT NULL);
  INSERT INTO livemap_schema VALUES (1);
  INSERT INTO hazards VALUES
    ('11111111-1111-4111-8111-111111111111', 'pothole', 0.75, 40.44, -79.94, 1, 0, 4, 2,
     1699999000000000000, 1699999900000000000, 1699999901000000000, 4, '', '', 1),
    ('22222222-2222-4222-8222-222222222222', 'deer', 0.5, 41, -80, 1, 0, 4, 1,
     1699999000000000000, 1699999000000000000, 1699999002000000000, 3, '', '', 0);
  INSERT INTO reports VALUES
    ('aaaaaaaa-aaaa-4aaa-8aaa-aaaaaaaaaaaa', '11111111-1111-4111-8111-111111111111', 'car-1', 'd',
     1699999000000000000, 1699999001000000000, 0.5, 40.44, -79.94, 1, 0, 4, ''),
    ('bbbbbbbb-bbbb-4bbb-8bbb-bbbbbbbbbbbb', '22222222-2222-4222-8222-222222222222', 'car-1', 'd',
     1699999000000000000, 1699999001000000000, 0.5, 41, -80, 1, 0, 4, ''),
    ('cccccccc-cccc-4ccc-8ccc-cccccccccccc', '11111111-1111-4111-8111-111111111111', 'car-2', 'd',
     1699999900000000000, 1699999901000000000, 0.5, 40.44, -79.94, 1, 0, 4, '');
  INSERT INTO events VALUES
    (1, '11111111-1111-4111-8111-111111111111', 0, 'report', 1699999001000000000),
    (2, '22222222-2222-4222-8222-222222222222', 0, 'report', 1699999001000000000),
    (3, '22222222-2222-4222-8222-222222222222', 2, 'repaired', 1699999002000000000),
    (4, '11111111-1111-4111-8111-111111111111', 1, 'sighting', 1699999901000000000);
)";

TEST_F(ZoneStoreTest, ADatabaseOfTheFirstVersionIsBroughtUpToDateWithAllItHolds) {
  SKIP_ON_POSTGRESQL();
  std::filesystem::create_directories(directory_ + "/zone");
  SqliteDatabase(DatabasePath(), true).Execute(kVersion1);
  for (int start = 0; start < 2; ++start) {
    ZoneService zone(Config(), Clock(), 1);
    EXPECT_EQ(zone.Sequence(), 4U);
    EXPECT_EQ(zone.AnnouncedSequence(), 4U);
    const auto pothole = zone.Find(*Uuid::Parse("11111111-1111-4111-8111-111111111111"));
    ASSERT_TRUE(pothole);
    EXPECT_EQ(pothole->state, HazardState::kActive);
    EXPECT_EQ(pothole->sightings, 2U);
    EXPECT_NEAR(pothole->presence, 0.9, 1e-6);
    const auto deer = zone.Find(*Uuid::Parse("22222222-2222-4222-8222-222222222222"));
    ASSERT_TRUE(deer);
    EXPECT_EQ(deer->state, HazardState::kGone);
    const auto history = zone.Events(deer->uuid, 10);
    ASSERT_EQ(history.size(), 2U);
    EXPECT_FALSE(history[0].from);
    EXPECT_EQ(history[1].from, HazardState::kActive);
    EXPECT_EQ(history[1].to, HazardState::kGone);
    EXPECT_EQ(history[1].reason, "repaired");
    EXPECT_EQ(zone.Events(pothole->uuid, 10).size(), 2U);
    protocol::Report repeated = MakeReport();
    repeated.uuid = *Uuid::Parse("cccccccc-cccc-4ccc-8ccc-cccccccccccc");
    repeated.vehicle_id = "car-2";
    EXPECT_EQ(zone.Handle(repeated).hazard_uuid, pothole->uuid);
    EXPECT_EQ(zone.Statistics().repeated, 1U);
  }
  ZoneService zone(Config(), Clock(), 1);
  EXPECT_EQ(zone.Handle(MakeReport({40.44, -79.94})).hazard_uuid,
            *Uuid::Parse("11111111-1111-4111-8111-111111111111"));
  EXPECT_EQ(zone.Sequence(), 5U);
}

/// What each version has that the one before has not, taken away again: from version 10 down.
std::string DowngradeTo(int version) {
  const std::vector<std::string> steps{
      "DROP TABLE hazard_trails; DELETE FROM livemap_schema WHERE version >= 10;",
      "DROP TABLE answer_pictures; DELETE FROM livemap_schema WHERE version >= 9;",
      "DROP TABLE decision_details; DROP TABLE assignments; DROP TABLE redirects; "
      "DELETE FROM livemap_schema WHERE version >= 8;",
      "DROP TABLE report_boxes; DELETE FROM livemap_schema WHERE version >= 7;",
      "DROP TABLE hazard_courses; DELETE FROM livemap_schema WHERE version >= 6;",
      std::string(kLastReportsTable) +
          "INSERT INTO last_reports SELECT vehicle_id, max(stamp_ns), latitude, longitude, sigma_m "
          "FROM places GROUP BY vehicle_id; DROP TABLE places; DROP TABLE decisions; "
          "DROP TABLE withdrawals; DELETE FROM livemap_schema WHERE version >= 5;",
      "DROP TABLE map_changes; DROP TABLE map_change_reports; DROP TABLE map_change_events; "
      "DELETE FROM livemap_schema WHERE version >= 4;",
      "DROP TABLE trust; DELETE FROM livemap_schema WHERE version >= 3;"};
  std::string sql;
  for (int step = 10; step > version; --step) sql += steps[static_cast<std::size_t>(10 - step)];
  return sql;
}

TEST_F(ZoneStoreTest, AStoreOfEachEarlierVersionIsBroughtUpToDateWithAllItHolds) {
  ASSERT_EQ(ZoneStore::SchemaVersion(), 10) << "a further version wants its step in this test";
  const int oldest = IsOnPostgresql() ? 8 : 2;  // Version 1 has a test of its own.
  for (int version = 9; version >= oldest; --version) {
    SCOPED_TRACE("version " + std::to_string(version));
    EmptyStore();
    std::string before;
    Uuid assigned;
    {
      ZoneService zone(Config(), Clock(), 1);
      assigned = zone.Handle(MakeReport({1, 1})).hazard_uuid;
      zone.Confirm(assigned, "Anna", "seen");
      DeskAction assignment;
      assignment.kind = DecisionKind::kAssign;
      assignment.team = "Roads";
      ASSERT_TRUE(zone.Act(assigned, "Anna", assignment));
      zone.Reject(zone.Handle(MakeReport({2, 1})).hazard_uuid, "Anna", "nothing there");
      protocol::MapChangeReport change = MakeBarrier();
      change.stamp_ns = kNowNs - kOneSecond;
      change.earlier_stamp_ns = kNowNs - kOneDay;
      ASSERT_EQ(zone.HandleMapChanges({change}).at(0).status,
                protocol::Receipt::Status::kCommitted);
      zone.Handle(MakeReport({3, 1}));  // The newest event is a hazard's.
      before = Everything(zone);
    }
    Probe().Execute(DowngradeTo(version));
    for (int start = 0; start < 2; ++start) {
      ZoneService zone(Config(), Clock(), 2);
      EXPECT_EQ(Everything(zone), before);
      EXPECT_EQ(zone.Statistics().store_damage.rows, 0U);
      EXPECT_EQ(zone.Assignments().size(), version >= 8 ? 1U : 0U);
      EXPECT_EQ(zone.DecisionsAbout(assigned, 10).size(), version >= 5 ? 2U : 0U);
      EXPECT_EQ(zone.QueryMapChanges(std::nullopt, 0, 10).size(), version >= 4 ? 1U : 0U);
      EXPECT_EQ(Probe().Number("SELECT max(version) FROM livemap_schema"), 10);
    }
    ZoneService zone(Config(), Clock(), 3);
    EXPECT_EQ(zone.Handle(MakeReport({1, 1})).hazard_uuid, assigned);
    EXPECT_TRUE(zone.Confirm(assigned, "Ben", "still there"));
  }
}

TEST_F(ZoneStoreTest, ACorruptStoreIsLeftAloneAndItsContentRecoverable) {
  SKIP_ON_POSTGRESQL();
  if (std::system("command -v sqlite3 > /dev/null") != 0) {
    GTEST_SKIP() << "skipped, no sqlite3";
  }
  std::vector<protocol::Report> reports;
  {
    ZoneService zone(Config(), Clock(), 1);
    for (int i = 0; i < 600; ++i) reports.push_back(MakeReport({1 + 0.01 * i, 1}));
    zone.HandleBatch(reports);
  }
  const std::string damaged = DatabasePath();
  {
    // One page in the middle of the file.
    std::fstream file(damaged, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(4096 * 30);
    file << std::string(4096, '\xa5');
  }
  const std::string content = ReadFile(damaged, 100 << 20);
  try {
    ZoneService(Config(), Clock(), 1);
    FAIL() << "the database is damaged";
  } catch (const StoreError& error) {
    EXPECT_THAT(error.what(), HasSubstr("recover"));
    EXPECT_THAT(error.what(), HasSubstr(damaged));
  }
  EXPECT_EQ(ReadFile(damaged, 100 << 20), content);

  // As docs/how-to/recover-a-store.md says.
  const std::string recover = "cd '" + directory_ +
                              "/zone' && mv zone.sqlite3 damaged.sqlite3 && " +
                              "sqlite3 damaged.sqlite3 .dump | sed 's/^ROLLBACK.*/COMMIT;/' | "
                              "sqlite3 zone.sqlite3";
  ASSERT_EQ(std::system(recover.c_str()), 0);
  ZoneService zone(Config(), Clock(), 2);
  // A page holds some dozens of rows.
  EXPECT_GE(zone.Query(std::nullopt, 0, 1000).size(), 500U);
  EXPECT_EQ(zone.Handle(MakeReport({50, 1})).status, protocol::Receipt::Status::kCommitted);
}

}  // namespace
}  // namespace livemap::zone
