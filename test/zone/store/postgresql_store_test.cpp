// What a server of PostgreSQL can do to a zone that a file cannot: go away in the middle, be used
// by others, and be set up so that it forgets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/error.h"
#include "common/sqlite.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"
#include "zone/store/postgresql_url.h"
#include "zone/store/zone_store.h"

namespace livemap::zone {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

class PostgresqlStoreTest : public PostgresqlZoneTest {
 protected:
  ZoneService::Config OnServer(const std::string& name = "zone") const {
    ZoneService::Config config = Config();
    config.directory = directory_ + "/" + name;
    config.store_url = url_;
    return config;
  }
  std::string WhyNotStarted(const ZoneService::Config& config) const {
    try {
      ZoneService(config, Clock(), 9);
    } catch (const StoreError& error) {
      return error.what();
    }
    return "";
  }
  /// The hazards' sightings are those of the reports, and each report has its event.
  void ExpectConsistent(double reports) {
    StoreProbe probe(url_);
    EXPECT_EQ(probe.Number("SELECT count(*) FROM reports"), reports);
    EXPECT_EQ(probe.Number("SELECT sum(sightings) FROM hazards"), reports);
    EXPECT_EQ(probe.Number("SELECT count(*) FROM events"), reports);
  }
};

/// As a vehicle does: the same report again until it is answered. How often it was refused.
int HandleUntilCommitted(ZoneService& zone, const protocol::Report& report) {
  std::string why;
  for (int failed = 0; failed < 300; ++failed) {
    try {
      EXPECT_EQ(zone.Handle(report).status, protocol::Receipt::Status::kCommitted);
      return failed;
    } catch (const StoreError& error) {
      why = error.what();
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }
  ADD_FAILURE() << "never committed: " << why;
  return 300;
}

std::string WhyUrlRefused(const std::string& url) {
  try {
    CheckedPostgresqlUrl(url);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(PostgresqlUrlTest, AUrlGetsAnEndToWaitingUnlessItNamesOne) {
  EXPECT_EQ(CheckedPostgresqlUrl("postgresql://zone@db.example.org/livemap?connect_timeout=9"),
            "postgresql://zone@db.example.org/livemap?connect_timeout=9&application_name=livemap"
            "&tcp_user_timeout=20000");
  EXPECT_THAT(CheckedPostgresqlUrl("postgres:///livemap"), HasSubstr("?connect_timeout=5"));
}

TEST(PostgresqlUrlTest, APasswordInAUrlIsRefusedAndNotRepeated) {
  for (const char* url : {"postgresql://zone:hunter2@db.example.org/livemap",
                          "postgresql://zone@db.example.org/livemap?password=hunter2"}) {
    EXPECT_THAT(WhyUrlRefused(url),
                AllOf(HasSubstr("password"), HasSubstr(".pgpass"), Not(HasSubstr("hunter2"))));
  }
}

TEST(PostgresqlUrlTest, WhatIsNoUrlOfADatabaseIsRefusedWithWhatIsAccepted) {
  for (const char* url :
       {"", "mysql://zone@host/livemap", "host=db dbname=livemap", "postgresql://zone@host",
        "postgresql://zone@host/live map", "postgresql://zone@host/livemap\n"}) {
    EXPECT_THAT(WhyUrlRefused(url), HasSubstr("accepted is postgresql://")) << url;
  }
  EXPECT_THAT(WhyUrlRefused("postgresql://host/livemap?colour=red"), HasSubstr("colour"));
}

TEST_F(PostgresqlStoreTest, NothingCommittedIsLostOrDoubledWhenTheServerIsKilled) {
  ZoneService zone(OnServer(), Clock(), 1);
  std::vector<protocol::Report> reports;
  for (int round = 0; round < 4; ++round) {
    std::thread committer([&] {
      int failed = 0;
      // Until the server was killed and is back.
      for (int i = 0; i < 40 || failed == 0; ++i) {
        reports.push_back(MakeReport({40 + 0.001 * (i % 50), 8}));
        failed += HandleUntilCommitted(zone, reports.back());
      }
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(30 + 40 * round));
    server_->Kill(SIGKILL);
    server_->Start();
    committer.join();
  }
  ExpectConsistent(static_cast<double>(reports.size()));
  for (const protocol::Report& report : reports) {
    EXPECT_EQ(zone.Handle(report).status, protocol::Receipt::Status::kCommitted);
  }
  EXPECT_EQ(zone.Statistics().repeated, reports.size()) << "each was there, once";
}

TEST_F(PostgresqlStoreTest, OfTwoRowsOfOneKeyInOneTransactionTheLaterStays) {
  ZoneStore store(url_);
  store.Begin();
  for (int round = 1; round <= 3; ++round) {
    for (const std::uint64_t vehicle : {1U, 2U}) {
      TrustRecord record;
      record.suspicion = round + 0.125 * static_cast<double>(vehicle);
      record.at_ns = kNowNs;
      store.WriteTrust(vehicle, record);
    }
  }
  store.Commit();
  std::map<std::uint64_t, double> suspicions;
  store.LoadTrust([&](std::uint64_t vehicle, const TrustRecord& record) {
    suspicions[vehicle] = record.suspicion;
  });
  EXPECT_THAT(suspicions, ElementsAre(Pair(1, 3.125), Pair(2, 3.25)));
}

TEST_F(PostgresqlStoreTest, ManyRowsOfOneTransactionAreThereAsTheyWereWritten) {
  ZoneStore store(url_);
  std::vector<protocol::Report> reports;
  std::vector<Uuid> asked;
  store.Begin();
  for (int i = 0; i < 2500; ++i) {
    reports.push_back(MakeReport({40 + 0.1 * i / 3, -80}));
    // What would end an array or a string of SQL.
    reports.back().vehicle_id = "{\"car\\',NULL}" + std::to_string(i);
    store.WriteReport(reports.back(), static_cast<std::uint64_t>(i) + 1, "", kNowNs);
    asked.push_back(reports.back().uuid);
    asked.push_back(MakeReport().uuid);
  }
  store.Commit();
  const auto known = store.FindReports(asked);
  ASSERT_EQ(known.size(), asked.size());
  for (std::size_t i = 0; i < reports.size(); ++i) {
    ASSERT_TRUE(known[2 * i]);
    EXPECT_EQ(known[2 * i]->vehicle_id, reports[i].vehicle_id);
    EXPECT_FALSE(known[2 * i + 1]) << "nobody told it";
  }
  StoreProbe probe(url_);
  EXPECT_EQ(probe.Number("SELECT latitude FROM reports WHERE hazard_id = 2001"),
            reports[2000].position.latitude_deg);
  EXPECT_EQ(probe.Number("SELECT count(*) FROM reports WHERE rowid = hazard_id"), 2500)
      << "rows are counted in their order";
}

TEST_F(PostgresqlStoreTest, AZeroByteInATextIsRefusedAndNothingOfItsTransactionIsKept) {
  ZoneStore store(url_);
  store.Begin();
  store.WriteTrust(1, {});
  protocol::Report report = MakeReport();
  report.drive_id = std::string("drive\0-1", 8);
  EXPECT_THROW(store.WriteReport(report, 1, "", kNowNs), StoreError);
  store.Rollback();
  StoreProbe probe(url_);
  EXPECT_EQ(probe.Number("SELECT count(*) FROM trust"), 0);
  EXPECT_EQ(probe.Number("SELECT count(*) FROM reports"), 0);
}

TEST_F(PostgresqlStoreTest, AHistoryIsReadAgainAfterTheServerWasKilled) {
  ZoneService zone(OnServer(), Clock(), 1);
  const Uuid hazard = zone.Handle(MakeReport()).hazard_uuid;
  server_->Kill(SIGKILL);
  EXPECT_THROW(zone.Events(hazard, 10), StoreError);
  EXPECT_TRUE(zone.Find(hazard)) << "what is in memory is told meanwhile";
  server_->Start();
  EXPECT_EQ(zone.Events(hazard, 10).size(), 1U);
}

TEST_F(PostgresqlStoreTest, AServerThatStandsStillIsNotWaitedForAndUsedAgainOnceItGoesOn) {
  ZoneService zone(OnServer(), Clock(), 1);
  zone.CheckStore();
  const auto writer = static_cast<pid_t>(StoreProbe(url_).Number(
      "SELECT a.pid FROM pg_stat_activity a JOIN pg_locks l ON l.pid = a.pid WHERE l.locktype = "
      "'advisory' AND a.datname = current_database()"));
  ASSERT_EQ(kill(writer, SIGSTOP), 0);
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_THROW(zone.CheckStore(), StoreError);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20)) << "2 s and load";
  EXPECT_FALSE(zone.IsStoreWell());
  EXPECT_THROW(zone.CheckStore(), StoreError) << "the server still has the other connection";
  ASSERT_EQ(kill(writer, SIGCONT), 0);
  zone.CheckStore();
  EXPECT_TRUE(zone.IsStoreWell());
  zone.Handle(MakeReport());
  ExpectConsistent(1);
}

TEST_F(PostgresqlStoreTest, ADatabaseThatAnotherZoneHasIsRefused) {
  ZoneService zone(OnServer(), Clock(), 1);
  EXPECT_THAT(WhyNotStarted(OnServer("other")), AllOf(HasSubstr("in use"), HasSubstr(url_)));
  zone.Handle(MakeReport());
  ExpectConsistent(1);
}

TEST_F(PostgresqlStoreTest, AZoneWhoseDatabaseAnotherOneHadMeanwhileWritesNoMore) {
  ZoneService zone(OnServer(), Clock(), 1);
  zone.Handle(MakeReport());
  StoreProbe(url_).Execute(
      "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid <> pg_backend_pid()");
  { ZoneService(OnServer("other"), Clock(), 2).Handle(MakeReport()); }
  for (int i = 0; i < 2; ++i) {
    try {
      zone.Handle(MakeReport());
      FAIL() << "its memory is not what the database holds";
    } catch (const StoreError& error) {
      EXPECT_THAT(error.what(), HasSubstr("another zone"));
    }
  }
  ExpectConsistent(2);
}

TEST_F(PostgresqlStoreTest, AServerThatDoesNotWaitForItsDiskIsRefused) {
  server_->Kill(SIGTERM);
  server_->Start("-c fsync=off");
  EXPECT_THAT(WhyNotStarted(OnServer()), HasSubstr("fsync"));
}

TEST_F(PostgresqlStoreTest, ADatabaseOfAnotherEncodingIsRefused) {
  StoreProbe(server_->Url("postgres"))
      .Execute("CREATE DATABASE latin ENCODING 'LATIN1' LOCALE 'C' TEMPLATE template0");
  url_ = server_->Url("latin");
  EXPECT_THAT(WhyNotStarted(OnServer()), AllOf(HasSubstr("LATIN1"), HasSubstr("UTF8")));
}

TEST_F(PostgresqlStoreTest, AZoneWithAnAddressThatNobodyServesDoesNotStart) {
  url_ = "postgresql://livemap@/zone?host=" + directory_;
  EXPECT_THAT(WhyNotStarted(OnServer()), AllOf(HasSubstr("opening"), HasSubstr(directory_)));
}

}  // namespace
}  // namespace livemap::zone
