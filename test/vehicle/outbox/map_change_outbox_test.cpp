#include "vehicle/outbox/map_change_outbox.h"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <random>

#include "common/error.h"

namespace livemap::vehicle {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

protocol::MapChangeReport SignGone(int number) {
  protocol::MapChangeReport report;
  report.uuid.bytes[0] = 4;
  report.uuid.bytes[15] = static_cast<std::uint8_t>(number);
  report.drive_id = "tuesday";
  report.stamp_ns = 1'700'000'000'000'000'000 + number * 1'000'000'000LL;
  report.earlier_stamp_ns = 1'690'000'000'000'000'000;
  report.class_name = "sign";
  report.vanished = true;
  report.confidence = 0.75F;
  report.seen = 7;
  report.missed = 2;
  report.position = {40.4433, -79.9436};
  report.covariance_m2 << 0.5, 0.125, 0.125, 0.25;
  return report;
}

protocol::Receipt Committed(const protocol::MapChangeReport& report) {
  protocol::Receipt receipt;
  receipt.status = protocol::Receipt::Status::kCommitted;
  receipt.report_uuid = report.uuid;
  return receipt;
}

class MapChangeOutboxTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directory(directory_);
    config_.path = directory_ + "/changes.sqlite3";
    config_.resend.jitter = 0;
    Restart();
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  void Restart() {
    outbox_.reset();
    outbox_ = std::make_unique<MapChangeOutbox>(config_, std::mt19937_64(1), 42, 0);
  }

  std::string directory_ = ::testing::TempDir() + "map_change_outbox_test";
  MapChangeOutbox::Config config_;
  std::unique_ptr<MapChangeOutbox> outbox_;
};

TEST_F(MapChangeOutboxTest, SendsAReportUntilTheZoneAnswersAlsoAfterARestart) {
  const protocol::MapChangeReport sign = SignGone(1);
  outbox_->Add(sign, 0);
  EXPECT_THAT(outbox_->TakeDue(0, 10), SizeIs(1));
  EXPECT_THAT(outbox_->TakeDue(0.5, 10), IsEmpty());
  EXPECT_THAT(outbox_->TakeDue(1.5, 10), SizeIs(1));
  EXPECT_EQ(outbox_->counters().sent, 1U);
  EXPECT_EQ(outbox_->counters().resends, 1U);
  Restart();
  const auto again = outbox_->TakeDue(0, 10);
  ASSERT_THAT(again, SizeIs(1));
  EXPECT_EQ(again[0].uuid, sign.uuid);
  EXPECT_EQ(again[0].drive_id, sign.drive_id);
  EXPECT_EQ(again[0].stamp_ns, sign.stamp_ns);
  EXPECT_EQ(again[0].earlier_stamp_ns, sign.earlier_stamp_ns);
  EXPECT_EQ(again[0].class_name, sign.class_name);
  EXPECT_TRUE(again[0].vanished);
  EXPECT_EQ(again[0].confidence, sign.confidence);
  EXPECT_EQ(again[0].seen, sign.seen);
  EXPECT_EQ(again[0].missed, sign.missed);
  EXPECT_EQ(again[0].position.latitude_deg, sign.position.latitude_deg);
  EXPECT_EQ(again[0].position.longitude_deg, sign.position.longitude_deg);
  EXPECT_EQ(again[0].covariance_m2, sign.covariance_m2);
  outbox_->AddReceipt(Committed(sign));
  outbox_->AddReceipt(Committed(sign));
  EXPECT_EQ(outbox_->counters().committed, 1U);
  Restart();
  EXPECT_EQ(outbox_->pending(), 0U);
}

TEST_F(MapChangeOutboxTest, AnAnswerToAnotherReportEndsNothing) {
  outbox_->Add(SignGone(1), 0);
  outbox_->AddReceipt(Committed(SignGone(2)));
  EXPECT_EQ(outbox_->pending(), 1U);
  EXPECT_EQ(outbox_->counters().committed, 0U);
}

TEST_F(MapChangeOutboxTest, OnlyTheZoneInWhichTheObjectLiesEndsItsReport) {
  config_.zone = "west";
  Restart();
  protocol::MapChangeReport in_east = SignGone(1);
  in_east.zone = "east";
  outbox_->Add(in_east, 0);
  outbox_->Add(SignGone(2), 0);
  Restart();
  const auto due = outbox_->TakeDue(0, 10);
  ASSERT_THAT(due, SizeIs(2));
  EXPECT_EQ(due[0].zone, "east");
  EXPECT_EQ(due[1].zone, "west") << "which is configured";
  protocol::Receipt receipt = Committed(in_east);
  receipt.zone = "west";
  outbox_->AddReceipt(receipt);
  EXPECT_EQ(outbox_->pending(), 2U);
  receipt.zone = "east";
  outbox_->AddReceipt(receipt);
  outbox_->AddReceipt(Committed(SignGone(2)));
  EXPECT_EQ(outbox_->pending(), 0U);
}

TEST_F(MapChangeOutboxTest, AReportForAZoneThatIsGoneGoesToTheOneOfItsPlace) {
  config_.zone = "west";
  Restart();
  std::string of_place = "east";
  const ZoneFinder zones = {[&](const geo::GeoPoint&) { return of_place; },
                            [&](const std::string& zone) { return zone != of_place; },
                            {}};
  outbox_->SetZones(zones);
  outbox_->Add(SignGone(1), 0);
  of_place = "north";
  EXPECT_EQ(outbox_->TakeDue(0, 10).at(0).zone, "north");
  Restart();
  EXPECT_EQ(outbox_->TakeDue(0, 10).at(0).zone, "north") << "that is on disk";
  of_place = "";
  outbox_->SetZones(zones);
  EXPECT_EQ(outbox_->TakeDue(3600, 10).at(0).zone, "west") << "no zone has the place";
}

TEST_F(MapChangeOutboxTest, RowsOfAnOlderProgramBelongToTheConfiguredZone) {
  outbox_->Add(SignGone(1), 0);
  outbox_.reset();
  SqliteDatabase(config_.path, true)
      .Execute("ALTER TABLE pending DROP COLUMN zone; PRAGMA user_version=1");
  config_.zone = "west";
  Restart();
  const auto due = outbox_->TakeDue(0, 10);
  ASSERT_THAT(due, SizeIs(1));
  EXPECT_EQ(due[0].zone, "west");
}

TEST_F(MapChangeOutboxTest, WhenFullTheOldestGoesAndIsCounted) {
  config_.most = 2;
  Restart();
  for (const int number : {2, 1, 3}) outbox_->Add(SignGone(number), 0);
  EXPECT_EQ(outbox_->counters().displaced, 1U);
  Restart();
  std::vector<int> numbers;
  for (const auto& report : outbox_->TakeDue(0, 10)) numbers.push_back(report.uuid.bytes[15]);
  EXPECT_THAT(numbers, ElementsAre(2, 3));
}

TEST_F(MapChangeOutboxTest, ReportsThatNoZoneAcceptsAreRefused) {
  const auto refused = [&](const auto& spoil) {
    protocol::MapChangeReport report = SignGone(1);
    spoil(report);
    EXPECT_THROW(outbox_->Add(report, 0), Error);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused([](protocol::MapChangeReport& r) { r.uuid = Uuid(); });
  refused([](protocol::MapChangeReport& r) { r.drive_id = ""; });
  refused([](protocol::MapChangeReport& r) { r.class_name = std::string(65, 'a'); });
  refused([](protocol::MapChangeReport& r) { r.stamp_ns = -1; });
  refused([](protocol::MapChangeReport& r) { r.confidence = 1.5F; });
  refused([](protocol::MapChangeReport& r) { r.seen = 1; });
  refused([&](protocol::MapChangeReport& r) { r.position.latitude_deg = nan; });
  refused([&](protocol::MapChangeReport& r) { r.covariance_m2(0, 1) = nan; });
  refused([](protocol::MapChangeReport& r) { r.covariance_m2(0, 0) = -1; });
  EXPECT_EQ(outbox_->pending(), 0U);
}

TEST_F(MapChangeOutboxTest, ACorruptFileIsSetAsideAndUnsoundRowsAreNeverSent) {
  outbox_->Add(SignGone(1), 0);
  outbox_->Add(SignGone(2), 0);
  outbox_.reset();
  SqliteDatabase(config_.path, false)
      .Execute("UPDATE pending SET latitude=1000 WHERE stamp_ns=1700000001000000000");
  Restart();
  EXPECT_EQ(outbox_->counters().unsound, 1U);
  EXPECT_THAT(outbox_->TakeDue(0, 10), SizeIs(1));

  outbox_.reset();
  for (const char* companion : {"", "-wal", "-shm"})
    std::filesystem::remove(config_.path + companion);
  std::ofstream(config_.path) << std::string(8192, 'x');
  Restart();
  EXPECT_THAT(outbox_->set_aside(), HasSubstr(".corrupt-42"));
  EXPECT_EQ(outbox_->pending(), 0U);
  outbox_->Add(SignGone(3), 0);
  EXPECT_EQ(outbox_->pending(), 1U);
}

}  // namespace
}  // namespace livemap::vehicle
