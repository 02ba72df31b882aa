#include "vehicle/alerts/announced_hazards.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "test/support/temporary_directory.h"
#include "vehicle/reporting/local_hazard_map.h"

namespace livemap::vehicle {
namespace {

using Action = protocol::Notice::Action;

Uuid IdOf(std::uint8_t number) {
  Uuid id;
  id.bytes[15] = number;
  return id;
}

protocol::Notice NoticeOf(std::uint8_t number, Action action, std::uint64_t sequence) {
  protocol::Notice notice;
  notice.action = action;
  notice.sequence = sequence;
  notice.previous_sequence = sequence - 1;
  notice.hazard_uuid = IdOf(number);
  notice.class_name = "pothole";
  notice.position = {49.2, 7.0};
  notice.covariance_m2 = 4 * Eigen::Matrix2d::Identity();
  notice.stamp_ns = 1'700'000'000'000'000'000;
  return notice;
}

StoredHazards::Row RowOf(std::uint8_t number, std::uint64_t sequence) {
  return {{IdOf(number), "pothole", {49.2, 7.0}, 0, std::nullopt}, sequence, ""};
}

TEST(AnnouncedHazardsTest, ANoticeAddsMovesAndTakesAway) {
  AnnouncedHazards hazards;
  auto changes = hazards.Apply(NoticeOf(1, Action::kAdded, 5));
  ASSERT_EQ(changes.put.size(), 1U);
  EXPECT_DOUBLE_EQ(changes.put[0].sigma_m, 2);
  EXPECT_EQ(hazards.Apply(NoticeOf(1, Action::kUpdated, 6)).put.size(), 1U);
  EXPECT_TRUE(hazards.Apply(NoticeOf(1, Action::kAdded, 5)).put.empty()) << "old news";
  changes = hazards.Apply(NoticeOf(1, Action::kRemoved, 7));
  EXPECT_EQ(changes.gone, std::vector<Uuid>{IdOf(1)});
  EXPECT_TRUE(hazards.Apply(NoticeOf(1, Action::kUpdated, 6)).put.empty()) << "it is gone";
  EXPECT_EQ(hazards.size(), 0U);
}

TEST(AnnouncedHazardsTest, WhatCannotBeIsLeftOut) {
  AnnouncedHazards hazards;
  protocol::Notice notice = NoticeOf(1, Action::kAdded, 5);
  notice.position.latitude_deg = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(hazards.Apply(notice).put.empty());
  notice = NoticeOf(0, Action::kAdded, 5);
  EXPECT_TRUE(hazards.Apply(notice).put.empty());
  notice = NoticeOf(1, Action::kAdded, 5);
  notice.course_rad = 6.3;
  EXPECT_TRUE(hazards.Apply(notice).put.empty());
  notice = NoticeOf(2, Action::kAdded, 5);
  notice.covariance_m2.setConstant(std::numeric_limits<double>::quiet_NaN());
  ASSERT_EQ(hazards.Apply(notice).put.size(), 1U);
}

TEST(AnnouncedHazardsTest, TheMapBringsWhatWasBeforeAndTakesWhatItNoLongerHas) {
  AnnouncedHazards hazards;
  EXPECT_EQ(hazards.Apply(StoredHazards{{RowOf(1, 5), RowOf(2, 6)}, {{"", 6}}}).put.size(), 2U);
  hazards.Apply(NoticeOf(3, Action::kAdded, 7));
  hazards.Apply(NoticeOf(2, Action::kRemoved, 8));
  const auto changes = hazards.Apply(StoredHazards{{RowOf(2, 6)}, {{"", 6}}});
  EXPECT_TRUE(changes.put.empty()) << "the notice of its removal is newer than the map";
  EXPECT_EQ(changes.gone, std::vector<Uuid>{IdOf(1)});
  EXPECT_EQ(hazards.size(), 1U) << "the third is newer than the map";
}

TEST(AnnouncedHazardsTest, AZoneThatBeganAnewCountsAnew) {
  AnnouncedHazards hazards;
  hazards.Apply(StoredHazards{{RowOf(1, 500), RowOf(2, 600)}, {{"", 600}}});
  const auto changes = hazards.Apply(StoredHazards{{RowOf(3, 1)}, {{"", 1}}});
  EXPECT_EQ(changes.put.size(), 1U);
  EXPECT_EQ(changes.gone, (std::vector<Uuid>{IdOf(1), IdOf(2)}));
}

TEST(AnnouncedHazardsTest, EachZonesWordCountsForItsOwnHazards) {
  AnnouncedHazards hazards;
  protocol::Notice west = NoticeOf(1, Action::kAdded, 500);
  west.zone = "west";
  protocol::Notice east = NoticeOf(2, Action::kAdded, 3);
  east.zone = "east";
  hazards.Apply(west);
  hazards.Apply(east);
  protocol::Notice foreign = NoticeOf(1, Action::kRemoved, 501);
  foreign.zone = "east";
  EXPECT_TRUE(hazards.Apply(foreign).gone.empty());
  // The map has taken in all of west's announcements and none of east's yet.
  EXPECT_EQ(hazards.Apply(StoredHazards{{}, {{"west", 500}}}).gone, std::vector<Uuid>{IdOf(1)});
  EXPECT_EQ(hazards.size(), 1U);
  // East begins to count anew; west does not.
  StoredHazards::Row row = RowOf(1, 501);
  row.zone = "west";
  hazards.Apply(StoredHazards{{row}, {{"east", 9}, {"west", 501}}});
  const auto changes = hazards.Apply(StoredHazards{{row}, {{"east", 1}, {"west", 501}}});
  EXPECT_TRUE(changes.gone.empty());
  EXPECT_EQ(hazards.size(), 1U);
}

TEST(AnnouncedHazardsTest, WhatTwoZonesAnnounceAtOnePlaceIsThereOnceUntilTheShownOneIsGone) {
  AnnouncedHazards hazards;
  protocol::Notice west = NoticeOf(1, Action::kAdded, 500);
  west.zone = "west";
  protocol::Notice east = NoticeOf(2, Action::kAdded, 3);
  east.zone = "east";
  EXPECT_EQ(hazards.Apply(west).put.size(), 1U);
  EXPECT_TRUE(hazards.Apply(east).put.empty());
  EXPECT_EQ(hazards.size(), 2U);
  EXPECT_EQ(hazards.hidden(), 1U);
  west.action = Action::kRemoved;
  west.sequence = 501;
  const auto changes = hazards.Apply(west);
  EXPECT_EQ(changes.gone, std::vector<Uuid>{IdOf(1)});
  ASSERT_EQ(changes.put.size(), 1U);
  EXPECT_EQ(changes.put[0].id, IdOf(2));
}

TEST(AnnouncedHazardsTest, WhatAZoneAnnouncesInAnothersAreaIsLeftOutAndCounted) {
  AnnouncedHazards hazards;
  hazards.RefuseBeyond(
      [](const std::string& zone, const geo::GeoPoint&) { return zone == "west"; });
  protocol::Notice notice = NoticeOf(1, Action::kAdded, 5);
  notice.zone = "west";
  EXPECT_TRUE(hazards.Apply(notice).put.empty());
  EXPECT_EQ(hazards.beyond_zone(), 1U);
  notice.zone = "east";
  EXPECT_EQ(hazards.Apply(notice).put.size(), 1U);
  notice.sequence = 6;
  notice.action = Action::kRemoved;
  EXPECT_EQ(hazards.Apply(notice).gone.size(), 1U);
  EXPECT_EQ(hazards.beyond_zone(), 1U);
}

TEST(AnnouncedHazardsTest, TheCourseOfThePassComesByNoticeAndByTheLocalMap) {
  const test::TemporaryDirectory directory;
  LocalHazardMap::Config config;
  config.path = directory.path() + "/map.sqlite3";
  LocalHazardMap map(config, protocol::HazardCatalogue(), 0);
  protocol::Notice notice = NoticeOf(1, Action::kAdded, 1);
  notice.course_rad = 1.5;
  protocol::Notice without = NoticeOf(2, Action::kAdded, 2);
  without.position.latitude_deg += 0.01;
  map.Apply(std::vector<protocol::Notice>{notice, without});
  const auto stored = ReadStoredHazards(config.path);
  ASSERT_TRUE(stored.has_value());
  ASSERT_EQ(stored->rows.size(), 2U);
  for (const StoredHazards::Row& row : stored->rows) {
    if (row.hazard.id == IdOf(2)) {
      EXPECT_TRUE(std::isnan(row.hazard.course_rad));
    } else {
      EXPECT_DOUBLE_EQ(row.hazard.course_rad, 1.5);
    }
  }
  AnnouncedHazards hazards;
  const auto changes = hazards.Apply(notice);
  ASSERT_EQ(changes.put.size(), 1U);
  EXPECT_DOUBLE_EQ(changes.put[0].course_rad, 1.5);
}

TEST(AnnouncedHazardsTest, ACourseThatIsToldLaterIsTakenAndNoneIsTakenAway) {
  const test::TemporaryDirectory directory;
  LocalHazardMap::Config config;
  config.path = directory.path() + "/map.sqlite3";
  LocalHazardMap map(config, protocol::HazardCatalogue(), 0);
  const protocol::Notice without = NoticeOf(1, Action::kAdded, 1);
  protocol::Notice with = without;
  with.course_rad = 1.5;
  protocol::Notice newer = NoticeOf(1, Action::kUpdated, 2);
  AnnouncedHazards hazards;
  const auto course_in_map = [&] {
    return ReadStoredHazards(config.path)->rows[0].hazard.course_rad;
  };
  const auto hear = [&](const protocol::Notice& notice) {
    map.Apply(std::vector<protocol::Notice>{notice});
    return hazards.Apply(notice).put;
  };
  ASSERT_EQ(hear(without).size(), 1U);
  EXPECT_TRUE(std::isnan(course_in_map()));
  const auto again = hear(with);
  ASSERT_EQ(again.size(), 1U) << "the same announcement, with a course";
  EXPECT_DOUBLE_EQ(again[0].course_rad, 1.5);
  EXPECT_DOUBLE_EQ(course_in_map(), 1.5);
  EXPECT_TRUE(hear(with).empty()) << "it is known now";
  const auto update = hear(newer);
  ASSERT_EQ(update.size(), 1U);
  EXPECT_DOUBLE_EQ(update[0].course_rad, 1.5) << "by a message that has none";
  EXPECT_DOUBLE_EQ(course_in_map(), 1.5);
  AnnouncedHazards by_map;
  by_map.Apply(StoredHazards{{RowOf(1, 5)}, {{"", 5}}});
  StoredHazards::Row row = RowOf(1, 5);
  row.hazard.course_rad = -0.5;
  const auto learned = by_map.Apply(StoredHazards{{row}, {{"", 5}}});
  ASSERT_EQ(learned.put.size(), 1U);
  EXPECT_DOUBLE_EQ(learned.put[0].course_rad, -0.5);
}

TEST(AnnouncedHazardsTest, TrailsAreTakenWhenTheyComeAndNoneIsTakenAway) {
  const test::TemporaryDirectory directory;
  LocalHazardMap::Config config;
  config.path = directory.path() + "/map.sqlite3";
  LocalHazardMap map(config, protocol::HazardCatalogue(), 0);
  const protocol::Notice without = NoticeOf(1, Action::kAdded, 1);
  protocol::Notice with = without;
  const geo::LocalFrame frame(with.position);
  with.trails = {{frame.ToGeo({-100, 0}), frame.ToGeo({-20, 0})}};
  protocol::Notice longer = with;
  longer.trails[0].push_back(frame.ToGeo({200, 0}));
  AnnouncedHazards hazards;
  const auto places_in_map = [&] {
    const auto stored = ReadStoredHazards(config.path);
    std::size_t places = 0;
    for (const auto& trail : stored->rows[0].hazard.trails) places += trail.size();
    return places;
  };
  const auto hear = [&](const protocol::Notice& notice) {
    map.Apply(std::vector<protocol::Notice>{notice});
    return hazards.Apply(notice).put;
  };
  ASSERT_EQ(hear(without).size(), 1U);
  EXPECT_EQ(places_in_map(), 0U);
  ASSERT_EQ(hear(with).size(), 1U) << "the same announcement, with a trail";
  EXPECT_EQ(places_in_map(), 2U);
  EXPECT_TRUE(hear(with).empty()) << "it is known now";
  ASSERT_EQ(hear(longer).size(), 1U) << "the zone knows more of it";
  EXPECT_EQ(places_in_map(), 3U);
  const auto update = hear(NoticeOf(1, Action::kUpdated, 2));
  ASSERT_EQ(update.size(), 1U);
  ASSERT_EQ(update[0].trails.size(), 1U) << "by a message that has none";
  EXPECT_EQ(places_in_map(), 3U);
  SqliteDatabase(config.path, true).Execute("UPDATE known SET trails = '2 x'");
  EXPECT_EQ(places_in_map(), 0U) << "what cannot be read counts for none";
}

TEST(AnnouncedHazardsTest, ALocalMapFromBeforeItHadCoursesIsReadOnceItHasThem) {
  const test::TemporaryDirectory directory;
  LocalHazardMap::Config config;
  config.path = directory.path() + "/map.sqlite3";
  {
    LocalHazardMap map(config, protocol::HazardCatalogue(), 0);
    map.Apply(std::vector<protocol::Notice>{NoticeOf(1, Action::kAdded, 1)});
  }
  SqliteDatabase(config.path, true)
      .Execute(
          "ALTER TABLE known DROP COLUMN course_rad; ALTER TABLE known DROP COLUMN trails;"
          " PRAGMA user_version=5;");
  EXPECT_FALSE(ReadStoredHazards(config.path).has_value());
  const LocalHazardMap migrated(config, protocol::HazardCatalogue(), 0);
  const auto stored = ReadStoredHazards(config.path);
  ASSERT_TRUE(stored.has_value());
  ASSERT_EQ(stored->rows.size(), 1U);
  EXPECT_TRUE(std::isnan(stored->rows[0].hazard.course_rad));
}

TEST(AnnouncedHazardsTest, ReadsTheLocalMapWhileItIsOpen) {
  const test::TemporaryDirectory directory;
  const std::string path = directory.path() + "/hazards.sqlite3";
  EXPECT_FALSE(ReadStoredHazards(path)) << "there is none yet";
  LocalHazardMap::Config config;
  config.path = path;
  LocalHazardMap map(config, {}, 0);
  map.Apply({NoticeOf(1, Action::kAdded, 1), NoticeOf(2, Action::kAdded, 2),
             NoticeOf(2, Action::kRemoved, 3)});
  protocol::Report own;
  own.uuid = IdOf(9);
  own.class_name = "pothole";
  own.position = {49.3, 7.0};
  map.Add(own);
  const auto stored = ReadStoredHazards(path);
  ASSERT_TRUE(stored);
  ASSERT_EQ(stored->rows.size(), 1U);
  EXPECT_EQ(stored->rows[0].hazard.id, IdOf(1));
  EXPECT_EQ(stored->rows[0].sequence, 1U);
  EXPECT_EQ(stored->sequences, (std::map<std::string, std::uint64_t>{{"", 3}}));
}

}  // namespace
}  // namespace livemap::vehicle
