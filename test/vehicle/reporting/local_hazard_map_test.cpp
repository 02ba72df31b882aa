#include "vehicle/reporting/local_hazard_map.h"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "test/support/temporary_directory.h"
#include "test/vehicle/reporting/known_reports.h"

namespace livemap::vehicle {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;
using AddResult = LocalHazardMap::AddResult;

protocol::Receipt MakeReceipt(protocol::Receipt::Status status, int report, int hazard) {
  protocol::Receipt receipt;
  receipt.status = status;
  receipt.report_uuid = Id(report);
  if (status == protocol::Receipt::Status::kCommitted) receipt.hazard_uuid = Id(hazard);
  return receipt;
}

class LocalHazardMapTest : public ::testing::Test {
 protected:
  LocalHazardMapTest() { config_.path = directory_.path() + "/local.sqlite3"; }

  LocalHazardMap Open() { return LocalHazardMap(config_, protocol::HazardCatalogue(), kNowNs); }

  test::TemporaryDirectory directory_;
  LocalHazardMap::Config config_;
};

TEST_F(LocalHazardMapTest, AddedHazardIsKnownAndToBeSentAfterARestart) {
  const protocol::Report report = MakeReport(1, kStreet);
  {
    LocalHazardMap map = Open();
    EXPECT_EQ(map.Add(report), AddResult::kAdded);
    map.MarkSent(Id(1));
  }
  LocalHazardMap map = Open();
  EXPECT_EQ(map.known_count(), 1u);
  EXPECT_TRUE(map.Find("pothole", East(3)));
  ASSERT_THAT(map.Pending(), SizeIs(1));
  EXPECT_EQ(map.Pending()[0].uuid, Id(1));
  EXPECT_EQ(map.Pending()[0].class_name, "pothole");
  EXPECT_TRUE(map.Pending()[0].sent);
  const auto loaded = map.LoadPending(Id(1));
  ASSERT_TRUE(loaded);
  EXPECT_EQ(loaded->drive_id, report.drive_id);
  EXPECT_EQ(loaded->stamp_ns, report.stamp_ns);
  EXPECT_EQ(loaded->confidence, report.confidence);
  EXPECT_EQ(loaded->box.x_max, report.box.x_max);
  EXPECT_EQ(loaded->position.latitude_deg, report.position.latitude_deg);
  EXPECT_EQ(loaded->position.longitude_deg, report.position.longitude_deg);
  EXPECT_EQ(loaded->covariance_m2, report.covariance_m2);
  EXPECT_EQ(loaded->image_width, report.image_width);
  EXPECT_EQ(loaded->image_frame_id, report.image_frame_id);
  EXPECT_EQ(loaded->image_format, report.image_format);
  EXPECT_EQ(loaded->image, report.image);
}

TEST_F(LocalHazardMapTest, DuplicateOfAKnownHazardIsNotStored) {
  LocalHazardMap map = Open();
  ASSERT_EQ(map.Add(MakeReport(1, kStreet)), AddResult::kAdded);
  EXPECT_EQ(map.Add(MakeReport(2, East(4))), AddResult::kDuplicate);
  EXPECT_EQ(map.Add(MakeReport(3, East(6))), AddResult::kAdded);
  EXPECT_EQ(map.Add(MakeReport(4, kStreet, "deer")), AddResult::kAdded);
  EXPECT_EQ(map.pending_count(), 3u);
}

TEST_F(LocalHazardMapTest, CommittedReportEndsAndItsHazardGoesOnUnderTheZonesId) {
  {
    LocalHazardMap map = Open();
    map.Add(MakeReport(1, kStreet));
    EXPECT_TRUE(map.Apply(MakeReceipt(protocol::Receipt::Status::kCommitted, 1, 900)));
    EXPECT_FALSE(map.Apply(MakeReceipt(protocol::Receipt::Status::kCommitted, 1, 900)))
        << "repeated";
    EXPECT_EQ(map.Find("pothole", kStreet)->id, Id(900));
  }
  LocalHazardMap map = Open();
  EXPECT_THAT(map.Pending(), SizeIs(0));
  EXPECT_EQ(map.Find("pothole", kStreet)->id, Id(900));
  map.Apply({MakeNotice(protocol::Notice::Action::kRemoved, 900, kStreet, 5)});
  EXPECT_FALSE(map.Find("pothole", kStreet)) << "the zone's id removes it";
}

TEST_F(LocalHazardMapTest, HazardAnnouncedBeforeItsReceiptIsKnownOnce) {
  LocalHazardMap map = Open();
  map.Add(MakeReport(1, kStreet));
  map.Apply({MakeNotice(protocol::Notice::Action::kAdded, 900, East(1), 5)});
  map.Apply(MakeReceipt(protocol::Receipt::Status::kCommitted, 1, 900));
  EXPECT_EQ(map.known_count(), 1u);
  EXPECT_THAT(map.Known(10), SizeIs(1));
  map.Apply({MakeNotice(protocol::Notice::Action::kRemoved, 900, East(1), 6)});
  EXPECT_EQ(map.known_count(), 0u);
}

TEST_F(LocalHazardMapTest, RefusedReportEndsAndItsHazardIsNotReportedAgain) {
  LocalHazardMap map = Open();
  map.Add(MakeReport(1, kStreet));
  EXPECT_TRUE(map.Apply(MakeReceipt(protocol::Receipt::Status::kRefused, 1, 0)));
  EXPECT_EQ(map.pending_count(), 0u);
  EXPECT_EQ(map.Add(MakeReport(2, kStreet)), AddResult::kDuplicate);
}

TEST_F(LocalHazardMapTest, AnnouncedHazardSuppressesUntilItIsRemoved) {
  {
    LocalHazardMap map = Open();
    EXPECT_EQ(map.Apply({MakeNotice(protocol::Notice::Action::kAdded, 900, kStreet, 5)}), 0u);
    EXPECT_EQ(map.Add(MakeReport(1, East(2))), AddResult::kDuplicate);
  }
  LocalHazardMap map = Open();
  EXPECT_EQ(map.Add(MakeReport(1, East(2))), AddResult::kDuplicate) << "remembered";
  map.Apply({MakeNotice(protocol::Notice::Action::kRemoved, 900, kStreet, 6)});
  EXPECT_EQ(map.Add(MakeReport(1, East(2))), AddResult::kAdded) << "gone, so reported anew";
}

TEST_F(LocalHazardMapTest, UpdateMovesAHazardAndOlderNewsDoNot) {
  LocalHazardMap map = Open();
  map.Apply({MakeNotice(protocol::Notice::Action::kAdded, 900, kStreet, 5),
             MakeNotice(protocol::Notice::Action::kUpdated, 900, East(20), 7),
             MakeNotice(protocol::Notice::Action::kUpdated, 900, East(40), 6),
             MakeNotice(protocol::Notice::Action::kRemoved, 900, East(40), 4)});
  EXPECT_EQ(map.known_count(), 1u);
  EXPECT_TRUE(map.Find("pothole", East(20)));
  EXPECT_FALSE(map.Find("pothole", kStreet));
}

TEST_F(LocalHazardMapTest, UnusableNoticesAreLeftOutAndCounted) {
  LocalHazardMap map = Open();
  protocol::Notice nowhere =
      MakeNotice(protocol::Notice::Action::kAdded, 901, {std::nan(""), 0}, 5);
  protocol::Notice nameless = MakeNotice(protocol::Notice::Action::kAdded, 902, kStreet, 5);
  nameless.hazard_uuid = Uuid{};
  protocol::Notice overlong = MakeNotice(protocol::Notice::Action::kAdded, 903, kStreet, 5);
  overlong.class_name.assign(65, 'x');
  protocol::Notice unsure = MakeNotice(protocol::Notice::Action::kAdded, 904, kStreet, 5);
  unsure.confidence = std::nanf("");
  EXPECT_EQ(map.Apply({nowhere, nameless, overlong, unsure,
                       MakeNotice(protocol::Notice::Action::kAdded, 900, kStreet, 5)}),
            4u);
  EXPECT_EQ(map.known_count(), 1u);
}

TEST_F(LocalHazardMapTest, ClassNameIsDataNotSql) {
  LocalHazardMap map = Open();
  const std::string name = "x'); DROP TABLE known; --";
  EXPECT_EQ(map.Add(MakeReport(1, kStreet, name)), AddResult::kAdded);
  EXPECT_EQ(map.Known(10).at(0).class_name, name);
}

TEST_F(LocalHazardMapTest, FullOfUnfinishedReportsRefusesNewOnesAndKeepsTheOld) {
  config_.max_pending = 2;
  LocalHazardMap map = Open();
  map.Add(MakeReport(1, East(0)));
  map.Add(MakeReport(2, East(10)));
  EXPECT_EQ(map.Add(MakeReport(3, East(20))), AddResult::kFull);
  EXPECT_FALSE(map.Find("pothole", East(20))) << "the next sight of it may report it";
  map.Apply(MakeReceipt(protocol::Receipt::Status::kCommitted, 1, 900));
  EXPECT_EQ(map.Add(MakeReport(3, East(20))), AddResult::kAdded);
}

TEST_F(LocalHazardMapTest, BeyondTheLimitTheHazardLongestWithoutNewsIsForgotten) {
  config_.max_known = 3;
  LocalHazardMap map = Open();
  map.Add(MakeReport(0, East(-50)));  // The oldest, but unfinished: never forgotten.
  for (int i = 1; i <= 4; ++i) {
    map.Apply({MakeNotice(protocol::Notice::Action::kAdded, 900 + i, East(20.0 * i),
                          static_cast<std::uint64_t>(i))});
  }
  EXPECT_EQ(map.known_count(), 3u);
  EXPECT_TRUE(map.Find("pothole", East(-50)));
  EXPECT_FALSE(map.Find("pothole", East(20)));
  EXPECT_FALSE(map.Find("pothole", East(40)));
  EXPECT_TRUE(map.Find("pothole", East(60)));
  EXPECT_TRUE(map.Find("pothole", East(80)));
}

class CorruptLocalHazardMap : public LocalHazardMapTest,
                              public ::testing::WithParamInterface<std::streamoff> {};

TEST_P(CorruptLocalHazardMap, IsSetAsideWholeAndANewOneStarts) {
  {
    LocalHazardMap map = Open();
    for (int i = 0; i < 200; ++i) map.Add(MakeReport(i, East(10.0 * i)));
  }
  const auto size = std::filesystem::file_size(config_.path);
  {
    std::fstream file(config_.path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(GetParam());
    file << std::string(30000, 'X');
  }
  LocalHazardMap map = Open();
  EXPECT_THAT(map.set_aside(), StartsWith(config_.path + ".corrupt-"));
  EXPECT_EQ(std::filesystem::file_size(map.set_aside()), size) << "its content stays recoverable";
  EXPECT_EQ(map.salvage().reports, map.pending_count());
  EXPECT_EQ(map.salvage().error, "");
  EXPECT_EQ(map.Add(MakeReport(999, East(-100))), AddResult::kAdded);
}

INSTANTIATE_TEST_SUITE_P(DamageAt, CorruptLocalHazardMap, ::testing::Values(0, 4096, 16384));

TEST_F(LocalHazardMapTest, SoundDatabaseIsNotSetAside) {
  { LocalHazardMap map = Open(); }
  EXPECT_EQ(Open().set_aside(), "");
}

TEST_F(LocalHazardMapTest, ReportsThatAnOlderProgramLeftAreStillThereAndShowTheWholeImage) {
  {
    LocalHazardMap map = Open();
    map.Add(MakeReport(1, East(10)));
    map.Add(MakeReport(2, East(30)));
    map.MarkSent(Id(2));
  }
  MakeOlder(config_.path);
  LocalHazardMap map = Open();
  EXPECT_EQ(map.set_aside(), "");
  ASSERT_EQ(map.pending_count(), 2u);
  for (const auto& pending : map.Pending()) EXPECT_EQ(pending.hold_until_ns, 0);
  const auto report = map.LoadPending(Id(1));
  ASSERT_TRUE(report);
  EXPECT_EQ(report->image, MakeReport(1, East(10)).image);
  EXPECT_TRUE(report->shown.IsWholeImage());
}

TEST_F(LocalHazardMapTest, RegionAndHoldSurviveARestart) {
  protocol::Report report = MakeReport(1, East(10));
  report.shown = {10, 20, 240, 160};
  Open().Add(report, 12345);
  LocalHazardMap map = Open();
  EXPECT_EQ(map.Pending().at(0).hold_until_ns, 12345);
  const imaging::PixelRegion shown = map.LoadPending(Id(1))->shown;
  EXPECT_EQ(shown.x, 10u);
  EXPECT_EQ(shown.y, 20u);
  EXPECT_EQ(shown.width, 240u);
  EXPECT_EQ(shown.height, 160u);
}

TEST_F(LocalHazardMapTest, DatabaseOfANewerProgramIsRefusedAndLeftAlone) {
  { LocalHazardMap map = Open(); }
  SqliteDatabase(config_.path, true).Execute("PRAGMA user_version=99");
  EXPECT_THROW(Open(), StoreError);
  EXPECT_TRUE(std::filesystem::exists(config_.path));
}

TEST_F(LocalHazardMapTest, UnwritableDirectoryIsAnErrorThatNamesThePath) {
  config_.path = directory_.path() + "/no/such/place.sqlite3";
  EXPECT_THAT([this] { Open(); },
              ::testing::ThrowsMessage<StoreError>(HasSubstr("/no/such/place.sqlite3")));
}

TEST_F(LocalHazardMapTest, WhatAddAcceptedSurvivesKillNine) {
  // The child tells through a pipe how many reports Add accepted, until it is killed.
  for (int round = 0; round < 5; ++round) {
    config_.path = directory_.path() + "/round" + std::to_string(round) + ".sqlite3";
    int channel[2];
    ASSERT_EQ(pipe(channel), 0);
    const pid_t child = fork();
    if (child == 0) {
      LocalHazardMap map = Open();
      for (int i = 0; i < 10000; ++i) {
        if (map.Add(MakeReport(i, East(10.0 * i))) != AddResult::kAdded) _exit(1);
        if (write(channel[1], "+", 1) != 1) _exit(1);
      }
      _exit(0);
    }
    close(channel[1]);
    std::size_t accepted = 0;
    char mark;
    while (read(channel[0], &mark, 1) == 1) {
      if (++accepted == 20u + 7u * static_cast<std::size_t>(round)) kill(child, SIGKILL);
    }
    close(channel[0]);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the child must die by the kill, not by itself";

    LocalHazardMap map = Open();
    EXPECT_EQ(map.set_aside(), "");
    EXPECT_GE(map.pending_count(), accepted);
    EXPECT_EQ(map.pending_count(), map.known_count()) << "known and to be sent are one";
    for (const auto& pending : map.Pending()) EXPECT_TRUE(map.LoadPending(pending.uuid));
  }
}

}  // namespace
}  // namespace livemap::vehicle
