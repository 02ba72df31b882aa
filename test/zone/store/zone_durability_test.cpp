#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>

#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

class ZoneDurabilityTest : public ZoneTest {
 protected:
  std::string WhyNotOpened() const {
    try {
      ZoneService(Config(), Clock(), 1);
    } catch (const StoreError& error) {
      return error.what();
    }
    return "";
  }
};

TEST_F(ZoneDurabilityTest, ARefusedCommitLeavesMapAndStoreAsTheyWere) {
  ZoneService zone(Config(), Clock(), 1);
  const Uuid known = zone.Handle(MakeReport({1, 1})).hazard_uuid;
  const Hazard before = *zone.Find(known);
  int events = 0;
  const int id = zone.Subscribe([&](const ZoneEvent&) { ++events; });
  StoreProbe saboteur = Probe();
  // Fails on the second event, when hazards and reports have been written.
  saboteur.Refuse("INSERT", "events", "no space left", "NEW.sequence = 3");
  const std::vector<protocol::Report> batch{MakeReport({1, 1}), MakeReport({2, 2})};
  try {
    zone.HandleBatch(batch);
    FAIL() << "the commit was sabotaged";
  } catch (const StoreError& error) {
    EXPECT_THAT(error.what(), HasSubstr("no space left"));
  }
  EXPECT_TRUE(SameHazard(*zone.Find(known), before));
  EXPECT_EQ(zone.Query(std::nullopt, 0, 10).size(), 1U);
  EXPECT_EQ(zone.Sequence(), 1U);
  EXPECT_EQ(events, 0);

  saboteur.Accept("events");
  for (const protocol::Receipt& receipt : zone.HandleBatch(batch)) {
    EXPECT_EQ(receipt.status, protocol::Receipt::Status::kCommitted);
  }
  EXPECT_EQ(zone.Find(known)->sightings, 2U);
  EXPECT_EQ(zone.Sequence(), 3U);
  EXPECT_EQ(events, 2);
  zone.Unsubscribe(id);
}

/// Commits reports one after the other, spread over 200 hazards, and writes each uuid to `pipe`
/// once its receipt is there, until it is killed.
[[noreturn]] void CommitUntilKilled(const ZoneService::Config& config, int round, int pipe) {
  ZoneService zone(
      config, [] { return kNowNs; }, static_cast<std::uint64_t>(round));
  std::mt19937_64 generator(static_cast<std::uint64_t>(round) + 1000);
  while (true) {
    protocol::Report report =
        MakeReport({40.0 + 0.001 * static_cast<double>(generator() % 200), 8.0});
    report.uuid = Uuid::Random(generator);
    zone.Handle(report);
    if (write(pipe, report.uuid.bytes.data(), 16) != 16) _exit(1);
  }
}

TEST_F(ZoneDurabilityTest, NothingCommittedIsLostOrDoubledWhenTheProcessIsKilled) {
  std::size_t acknowledged = 0;
  for (int round = 0; round < 5; ++round) {
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) CommitUntilKilled(Config(), round, ends[1]);
    close(ends[1]);
    Uuid uuid;
    std::vector<Uuid> uuids;
    // Kill at a different depth each round, in the middle of whatever it then does.
    while (uuids.size() < 40U + 17U * static_cast<unsigned>(round) &&
           read(ends[0], uuid.bytes.data(), 16) == 16) {
      uuids.push_back(uuid);
    }
    kill(child, SIGKILL);
    while (read(ends[0], uuid.bytes.data(), 16) == 16) uuids.push_back(uuid);
    close(ends[0]);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status));

    ZoneStore store(Database());
    for (const auto& committed : store.FindReports(uuids)) EXPECT_TRUE(committed);
    acknowledged += uuids.size();
    StoreProbe probe = Probe();
    const double reports = probe.Number("SELECT count(*) FROM reports");
    EXPECT_EQ(probe.Number("SELECT sum(sightings) FROM hazards"), reports);
    EXPECT_EQ(probe.Number("SELECT count(*) FROM events"), reports);
    // At most one report per kill was committed without anybody hearing of it.
    EXPECT_LE(reports, static_cast<double>(acknowledged) + round + 1);
  }
  ZoneService zone(Config(), Clock(), 77);
  EXPECT_EQ(zone.Handle(MakeReport({40.0, 8.0})).status, protocol::Receipt::Status::kCommitted);
}

TEST_F(ZoneDurabilityTest, RefusesAFileThatIsNoDatabase) {
  SKIP_ON_POSTGRESQL();
  std::filesystem::create_directories(directory_ + "/zone");
  std::ofstream(DatabasePath()) << std::string(5000, 'x');
  EXPECT_THAT(WhyNotOpened(), testing::AllOf(HasSubstr(DatabasePath()), HasSubstr("database")));
}

TEST_F(ZoneDurabilityTest, RefusesADamagedDatabase) {
  SKIP_ON_POSTGRESQL();
  {
    ZoneService zone(Config(), Clock(), 1);
    std::vector<protocol::Report> reports;
    for (int i = 0; i < 300; ++i) reports.push_back(MakeReport({1 + 0.01 * i, 1}));
    zone.HandleBatch(reports);
  }
  std::fstream file(DatabasePath(), std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(4096 * 5);
  file << std::string(4096 * 6, '\xa5');
  file.close();
  EXPECT_THAT(WhyNotOpened(), HasSubstr(DatabasePath()));
}

TEST_F(ZoneDurabilityTest, RefusesASchemaNewerThanItself) {
  { ZoneService zone(Config(), Clock(), 1); }
  Probe().Execute("INSERT INTO livemap_schema VALUES (99)");
  EXPECT_THAT(WhyNotOpened(), testing::AllOf(HasSubstr("99"), HasSubstr("version")));
}

TEST_F(ZoneDurabilityTest, RefusesADirectoryThatAnotherZoneUses) {
  ZoneService zone(Config(), Clock(), 1);
  EXPECT_THAT(WhyNotOpened(), HasSubstr("in use"));
}

TEST_F(ZoneDurabilityTest, RefusesADirectoryThatCannotBeMade) {
  std::ofstream(directory_ + "/zone") << "a file";
  EXPECT_THAT(WhyNotOpened(), HasSubstr("cannot be made"));
}

TEST_F(ZoneDurabilityTest, WorksInADirectoryWithBlanksAndQuotes) {
  SKIP_ON_POSTGRESQL();
  ZoneService::Config config = Config();
  config.directory = directory_ + "/a zone's; directory=x";
  { ZoneService(config, Clock(), 1).Handle(MakeReport()); }
  EXPECT_EQ(ZoneService(config, Clock(), 1).Query(std::nullopt, 0, 10).size(), 1U);
  EXPECT_TRUE(std::filesystem::exists(config.directory + "/zone.sqlite3"));
}

TEST_F(ZoneDurabilityTest, HostileTextIsDataNotSql) {
  ZoneService zone(Config(), Clock(), 1);
  protocol::Report report = MakeReport();
  report.class_name = "x'); DROP TABLE hazards; --";
  report.vehicle_id = "' OR '1'='1";
  report.drive_id = ":uuid ? $1";
  EXPECT_EQ(zone.Handle(report).status, protocol::Receipt::Status::kCommitted);
  const auto hazards = zone.Query(std::nullopt, 0, 10);
  ASSERT_EQ(hazards.size(), 1U);
  EXPECT_EQ(hazards[0].class_name, report.class_name);
  EXPECT_TRUE(zone.Remove(hazards[0].uuid, "'); DROP TABLE events; --"));
}

}  // namespace
}  // namespace livemap::zone
