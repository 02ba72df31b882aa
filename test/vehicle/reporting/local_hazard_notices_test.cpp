#include <gmock/gmock.h>

#include "test/support/temporary_directory.h"
#include "test/vehicle/reporting/known_reports.h"
#include "vehicle/reporting/local_hazard_map.h"
#include "vehicle/reporting/notice_sequence_tracker.h"

namespace livemap::vehicle {
namespace {

constexpr protocol::Notice::Action kAdded = protocol::Notice::Action::kAdded;
constexpr protocol::Notice::Action kUpdated = protocol::Notice::Action::kUpdated;
constexpr protocol::Notice::Action kRemoved = protocol::Notice::Action::kRemoved;

TEST(NoticeSequenceTracker, KnowsAllUpToTheFirstGapAndGoesOnOnceItIsClosed) {
  NoticeSequenceTracker chain(4);
  EXPECT_TRUE(chain.Add(4, 7)) << "sequences need not be neighbours";
  EXPECT_FALSE(chain.Add(9, 12));
  EXPECT_FALSE(chain.Add(12, 13));
  EXPECT_EQ(chain.known(), 7u);
  EXPECT_TRUE(chain.has_gap());
  EXPECT_TRUE(chain.Add(7, 9)) << "the missing one came late";
  EXPECT_EQ(chain.known(), 13u);
  EXPECT_FALSE(chain.has_gap());
  EXPECT_TRUE(chain.Add(4, 7)) << "a repetition is no news";
  EXPECT_EQ(chain.known(), 13u);
}

TEST(NoticeSequenceTracker, AManyTimesBrokenStreamStaysBounded) {
  NoticeSequenceTracker chain(1);
  for (std::uint64_t i = 0; i < 50000; ++i) chain.Add(3 + 2 * i, 4 + 2 * i);
  EXPECT_EQ(chain.known(), 1u);
  chain.CloseTo(200000);
  EXPECT_EQ(chain.known(), 200000u);
  EXPECT_FALSE(chain.has_gap());
}

/// To everybody.
protocol::Notice Announcement(protocol::Notice::Action action, int hazard,
                              const geo::GeoPoint& position, std::uint64_t previous,
                              std::uint64_t sequence) {
  protocol::Notice notice = MakeNotice(action, hazard, position, sequence);
  notice.previous_sequence = previous;
  return notice;
}

/// To this vehicle alone.
protocol::Notice Told(protocol::Notice::Action action, int hazard, const geo::GeoPoint& position,
                      std::uint64_t sequence) {
  protocol::Notice notice = MakeNotice(action, hazard, position, sequence);
  notice.vehicle_id = "car-1";
  return notice;
}

protocol::Notice CaughtUp(std::uint64_t from, std::uint64_t sequence, std::uint32_t told,
                          double radius_m = 1000) {
  protocol::Notice notice;
  notice.action = protocol::Notice::Action::kCaughtUp;
  notice.vehicle_id = "car-1";
  notice.previous_sequence = from;
  notice.sequence = sequence;
  notice.told = told;
  notice.position = kStreet;
  notice.radius_m = radius_m;
  return notice;
}

class LocalHazardNotices : public ::testing::Test {
 protected:
  LocalHazardNotices() {
    config_.path = directory_.path() + "/local.sqlite3";
    Restart();
  }
  void Restart() {
    map_.reset();
    map_ = std::make_unique<LocalHazardMap>(config_, protocol::HazardCatalogue(), kNowNs);
  }

  test::TemporaryDirectory directory_;
  LocalHazardMap::Config config_;
  std::unique_ptr<LocalHazardMap> map_;
};

TEST_F(LocalHazardNotices, AHazardRemovedWhileOfflineDisappearsWithTheCatchUpAlsoOverARestart) {
  map_->Apply({Announcement(kAdded, 1, kStreet, 0, 3), Announcement(kAdded, 2, East(50), 3, 5)});
  EXPECT_EQ(map_->map_sequence(), 5u);
  // Offline: removal 6 of hazard 1 is missed. Online again, another announcement comes.
  Restart();
  EXPECT_EQ(map_->map_sequence(), 5u) << "the vehicle says from where it needs to be told";
  map_->Apply({Announcement(kAdded, 3, East(100), 6, 9)});
  EXPECT_EQ(map_->map_sequence(), 5u);
  EXPECT_TRUE(map_->has_gap());
  EXPECT_TRUE(map_->Find("pothole", kStreet)) << "still there: nobody has told";
  map_->Apply({Told(kRemoved, 1, kStreet, 6), CaughtUp(5, 6, 1)});
  EXPECT_FALSE(map_->Find("pothole", kStreet));
  EXPECT_TRUE(map_->Find("pothole", East(50)));
  EXPECT_TRUE(map_->Find("pothole", East(100)));
  EXPECT_EQ(map_->map_sequence(), 9u) << "what came ahead counts now";
  Restart();
  EXPECT_EQ(map_->map_sequence(), 9u);
  EXPECT_EQ(map_->known_count(), 2u);
}

TEST_F(LocalHazardNotices, WhatATellingOfAllThatIsThereLeavesOutIsGoneWithinItsRadius) {
  map_->Apply({Announcement(kAdded, 1, kStreet, 0, 3), Announcement(kAdded, 2, East(50), 3, 4),
               Announcement(kAdded, 3, East(5000), 4, 5), Announcement(kAdded, 4, East(80), 5, 9)});
  map_->Add(MakeReport(100, East(-50)));
  map_->Apply({Told(kAdded, 2, East(50), 4), CaughtUp(0, 8, 1)});
  EXPECT_FALSE(map_->Find("pothole", kStreet)) << "not told, so gone";
  EXPECT_TRUE(map_->Find("pothole", East(50))) << "told";
  EXPECT_TRUE(map_->Find("pothole", East(5000))) << "outside of what was told";
  EXPECT_TRUE(map_->Find("pothole", East(80))) << "newer than the telling";
  EXPECT_TRUE(map_->Find("pothole", East(-50))) << "its own, not the zone's to tell";
}

TEST_F(LocalHazardNotices, ACatchUpOfWhichSomeDidNotArriveClosesNothing) {
  map_->Apply({Announcement(kAdded, 1, kStreet, 0, 3)});
  EXPECT_EQ(map_->Apply({Told(kAdded, 2, East(50), 5), CaughtUp(3, 6, 2)}), 1u);
  EXPECT_EQ(map_->map_sequence(), 3u) << "two were told, one came";
  EXPECT_EQ(map_->Apply({Told(kAdded, 2, East(50), 5), CaughtUp(0, 6, 2)}), 1u)
      << "what came for the one before does not count twice";
  EXPECT_TRUE(map_->Find("pothole", kStreet)) << "nor is anything taken away";
  EXPECT_EQ(
      map_->Apply({Told(kAdded, 2, East(50), 5), Told(kRemoved, 1, kStreet, 6), CaughtUp(3, 6, 2)}),
      0u);
  EXPECT_EQ(map_->map_sequence(), 6u);
}

TEST_F(LocalHazardNotices, ACatchUpThatBeganLaterThanThisVehicleKnowsClosesNothing) {
  map_->Apply({Announcement(kAdded, 1, kStreet, 0, 3)});
  EXPECT_EQ(map_->Apply({CaughtUp(5, 8, 0)}), 1u);
  EXPECT_EQ(map_->map_sequence(), 3u);
}

TEST_F(LocalHazardNotices, AnOlderNoticeThatComesAfterTheRemovalDoesNotBringTheHazardBack) {
  map_->Apply({Announcement(kAdded, 1, kStreet, 0, 3), Announcement(kRemoved, 1, kStreet, 3, 4)});
  map_->Apply({Told(kUpdated, 1, kStreet, 3)});
  EXPECT_FALSE(map_->Find("pothole", kStreet));
  Restart();
  map_->Apply({Told(kUpdated, 1, kStreet, 3)});
  EXPECT_FALSE(map_->Find("pothole", kStreet)) << "nor after a restart";
  map_->Apply({Announcement(kAdded, 1, kStreet, 4, 8)});
  EXPECT_TRUE(map_->Find("pothole", kStreet)) << "a newer one does: an official revoked";
}

TEST_F(LocalHazardNotices, AZoneThatBeganAnewTakesEverythingOfBeforeAway) {
  map_->Apply(
      {Announcement(kAdded, 1, kStreet, 0, 400), Announcement(kAdded, 2, East(9000), 400, 500)});
  map_->Apply({Announcement(kAdded, 3, East(50), 1, 2)});
  map_->Apply({Told(kAdded, 3, East(50), 2), CaughtUp(500, 2, 1)});
  EXPECT_EQ(map_->map_sequence(), 2u);
  EXPECT_EQ(map_->known_count(), 1u);
  EXPECT_TRUE(map_->Find("pothole", East(50)));
}

TEST_F(LocalHazardNotices, AStaleCatchUpDoesNotSetTheVehicleBack) {
  map_->Apply({Announcement(kAdded, 1, kStreet, 0, 3), Announcement(kAdded, 2, East(50), 3, 9)});
  EXPECT_EQ(map_->Apply({CaughtUp(3, 5, 0)}), 0u);
  EXPECT_EQ(map_->map_sequence(), 9u);
}

TEST_F(LocalHazardNotices, AHostileCatchUpIsLeftOut) {
  protocol::Notice nowhere = CaughtUp(0, 8, 0);
  nowhere.position.latitude_deg = std::nan("");
  protocol::Notice endless = CaughtUp(0, 8, 0, std::numeric_limits<double>::infinity());
  protocol::Notice huge = Told(kAdded, 1, kStreet, std::numeric_limits<std::uint64_t>::max());
  EXPECT_EQ(map_->Apply({nowhere, endless, huge}), 3u);
  EXPECT_EQ(map_->map_sequence(), 0u);
}

}  // namespace
}  // namespace livemap::vehicle
