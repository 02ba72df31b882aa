#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "test/support/temporary_directory.h"
#include "test/vehicle/reporting/known_reports.h"
#include "vehicle/reporting/local_hazard_map.h"

namespace livemap::vehicle {
namespace {

constexpr protocol::Notice::Action kCellAdded = protocol::Notice::Action::kAdded;
constexpr protocol::Notice::Action kCellRemoved = protocol::Notice::Action::kRemoved;
constexpr double kFarM = 20000;  // Cells are smaller.

/// To the vehicles of its cell.
protocol::Notice CellNotice(protocol::Notice::Action action, int hazard,
                            const geo::GeoPoint& position, std::uint64_t previous,
                            std::uint64_t sequence) {
  protocol::Notice notice = MakeNotice(action, hazard, position, sequence);
  notice.previous_sequence = previous;
  notice.cell = geo::MapCell::At(position);
  return notice;
}

protocol::CellNews::Hazard There(int hazard, const geo::GeoPoint& position,
                                 std::uint64_t sequence) {
  const protocol::Notice notice = MakeNotice(kCellAdded, hazard, position, sequence);
  return {notice.hazard_uuid, sequence, false,          notice.class_name,
          notice.confidence,  position, notice.stamp_ns};
}

protocol::CellNews::Hazard Gone(int hazard, std::uint64_t sequence) {
  protocol::CellNews::Hazard gone;
  gone.hazard_uuid = MakeNotice(kCellRemoved, hazard, kStreet, sequence).hazard_uuid;
  gone.sequence = sequence;
  gone.removed = true;
  return gone;
}

protocol::CellNews NewsOf(const geo::GeoPoint& place, std::uint64_t since, std::uint64_t sequence,
                          std::vector<protocol::CellNews::Hazard> hazards) {
  protocol::CellNews news;
  news.cells.push_back({geo::MapCell::At(place), since, sequence, std::move(hazards)});
  return news;
}

class LocalHazardCells : public ::testing::Test {
 protected:
  LocalHazardCells() {
    config_.path = directory_.path() + "/local.sqlite3";
    Restart();
  }
  void Restart() {
    map_.reset();
    map_ = std::make_unique<LocalHazardMap>(config_, protocol::HazardCatalogue(), kNowNs);
  }
  std::uint64_t Sequence(const geo::GeoPoint& place = kStreet) const {
    return map_->cell_sequence("", geo::MapCell::At(place));
  }
  bool HasGap(const geo::GeoPoint& place = kStreet) const {
    return map_->has_cell_gap("", geo::MapCell::At(place));
  }

  test::TemporaryDirectory directory_;
  LocalHazardMap::Config config_;
  std::unique_ptr<LocalHazardMap> map_;
};

TEST_F(LocalHazardCells, EachCellCountsForItselfAlsoOverARestart) {
  const auto use = map_->Apply(NewsOf(kStreet, 0, 7, {There(1, kStreet, 3)}));
  EXPECT_EQ(use.known.size(), 1u);
  EXPECT_EQ(use.unusable, 0u);
  EXPECT_EQ(Sequence(), 7u);
  EXPECT_EQ(Sequence(East(kFarM)), 0u);
  EXPECT_EQ(map_->map_sequence(), 0u) << "of the rest of the zone nothing is known";
  map_->Apply({CellNotice(kCellAdded, 2, kStreet, 3, 9)});
  EXPECT_EQ(Sequence(), 9u);
  Restart();
  EXPECT_EQ(Sequence(), 9u);
  EXPECT_TRUE(map_->Find("pothole", kStreet));
}

TEST_F(LocalHazardCells, AnAnnouncementThatNeverCameIsAGapOfItsCellAlone) {
  map_->Apply(NewsOf(kStreet, 0, 7, {}));
  map_->Apply(NewsOf(East(kFarM), 0, 7, {}));
  map_->Apply({CellNotice(kCellAdded, 2, kStreet, 8, 9)});
  EXPECT_TRUE(HasGap());
  EXPECT_FALSE(HasGap(East(kFarM)));
  EXPECT_TRUE(map_->has_gap());
  EXPECT_EQ(Sequence(), 7u);
  map_->Apply(NewsOf(kStreet, 7, 9, {There(3, East(100), 8), There(2, kStreet, 9)}));
  EXPECT_FALSE(HasGap());
  EXPECT_EQ(Sequence(), 9u);
  EXPECT_TRUE(map_->Find("pothole", East(100)));
}

TEST_F(LocalHazardCells, WhatWasRemovedWhileItWasAwayDisappears) {
  map_->Apply(NewsOf(kStreet, 0, 7, {There(1, kStreet, 3), There(2, East(100), 4)}));
  map_->Apply(NewsOf(kStreet, 7, 12, {Gone(1, 11)}));
  EXPECT_FALSE(map_->Find("pothole", kStreet));
  EXPECT_TRUE(map_->Find("pothole", East(100)));
  EXPECT_EQ(Sequence(), 12u);
}

TEST_F(LocalHazardCells, WhatAWholeCellDoesNotHaveIsGoneAndOtherCellsStay) {
  map_->Apply(NewsOf(kStreet, 0, 7, {There(1, kStreet, 3), There(2, East(100), 4)}));
  map_->Apply(NewsOf(East(kFarM), 0, 7, {There(3, East(kFarM), 5)}));
  map_->Add(MakeReport(100, East(-50)));
  map_->Apply({CellNotice(kCellAdded, 4, East(150), 4, 13)});
  map_->Apply(NewsOf(kStreet, 0, 12, {There(2, East(100), 4)}));
  EXPECT_FALSE(map_->Find("pothole", kStreet)) << "not told, so gone";
  EXPECT_TRUE(map_->Find("pothole", East(100))) << "told";
  EXPECT_TRUE(map_->Find("pothole", East(-50))) << "its own";
  EXPECT_TRUE(map_->Find("pothole", East(150))) << "newer than what was told";
  EXPECT_TRUE(map_->Find("pothole", East(kFarM))) << "in another cell";
  EXPECT_EQ(Sequence(), 13u);
}

TEST_F(LocalHazardCells, AnAnswerToWhatTheVehicleNoLongerKnowsIsLeftOut) {
  const auto use = map_->Apply(NewsOf(kStreet, 7, 12, {There(2, East(100), 9)}));
  EXPECT_TRUE(use.known.empty());
  EXPECT_EQ(Sequence(), 0u);
  EXPECT_EQ(map_->known_count(), 0u);
}

TEST_F(LocalHazardCells, OfAZoneThatBeganAnewOnlyWhatItTellsNowIsThere) {
  map_->Apply(NewsOf(kStreet, 0, 700, {There(1, kStreet, 300), There(2, East(100), 400)}));
  map_->Apply(NewsOf(kStreet, 700, 701, {Gone(1, 701)}));
  // A backup, which has both under lower numbers.
  map_->Apply(NewsOf(kStreet, 701, 5, {There(1, kStreet, 3)}));
  EXPECT_TRUE(map_->Find("pothole", kStreet));
  EXPECT_FALSE(map_->Find("pothole", East(100)));
  EXPECT_EQ(Sequence(), 5u);
}

TEST_F(LocalHazardCells, AHazardThatCrossesAnEdgeStaysInWhicheverOrderItsNoticesCome) {
  map_->Apply(NewsOf(East(kFarM), 0, 7, {There(1, East(kFarM), 3), There(2, East(kFarM + 50), 4)}));
  map_->Apply(NewsOf(kStreet, 0, 7, {}));
  map_->Apply(
      {CellNotice(kCellRemoved, 1, East(kFarM), 4, 9), CellNotice(kCellAdded, 1, kStreet, 5, 9)});
  map_->Apply({CellNotice(kCellAdded, 2, East(100), 9, 11),
               CellNotice(kCellRemoved, 2, East(kFarM), 9, 11)});
  EXPECT_TRUE(map_->Find("pothole", kStreet));
  EXPECT_TRUE(map_->Find("pothole", East(100)));
  EXPECT_FALSE(map_->Find("pothole", East(kFarM)));
  EXPECT_FALSE(map_->Find("pothole", East(kFarM + 50)));
  EXPECT_EQ(Sequence(), 11u);
  EXPECT_EQ(Sequence(East(kFarM)), 11u);
}

TEST_F(LocalHazardCells, ZonesDoNotTouchEachOthersCells) {
  config_.zone = "west";
  Restart();
  protocol::CellNews news = NewsOf(kStreet, 0, 7, {There(1, kStreet, 3)});
  map_->Apply(news);
  news = NewsOf(kStreet, 0, 4, {});
  news.zone = "east";
  map_->Apply(news);
  EXPECT_TRUE(map_->Find("pothole", kStreet));
  EXPECT_EQ(map_->cell_sequence("west", geo::MapCell::At(kStreet)), 7u);
  EXPECT_EQ(map_->cell_sequence("", geo::MapCell::At(kStreet)), 7u);
  EXPECT_EQ(map_->cell_sequence("east", geo::MapCell::At(kStreet)), 4u);
  map_->ForgetZones([](const std::string& zone) { return zone == "east"; });
  EXPECT_EQ(map_->cell_sequence("east", geo::MapCell::At(kStreet)), 0u);
  EXPECT_EQ(map_->cell_sequence("west", geo::MapCell::At(kStreet)), 7u);
}

TEST_F(LocalHazardCells, ACellOfWhichSomethingIsForgottenIsAskedAnew) {
  config_.max_known = 2;
  Restart();
  map_->Apply(NewsOf(kStreet, 0, 7, {There(1, kStreet, 3)}));
  protocol::CellNews news =
      NewsOf(East(kFarM), 0, 7, {There(2, East(kFarM), 4), There(3, East(kFarM + 100), 5)});
  for (auto& hazard : news.cells.front().hazards) hazard.stamp_ns += 1'000'000'000;
  map_->Apply(news);
  EXPECT_EQ(map_->known_count(), 2u);
  EXPECT_EQ(Sequence(), 0u) << "its hazard, the one longest without news, is forgotten";
  EXPECT_EQ(Sequence(East(kFarM)), 7u);
  Restart();
  EXPECT_EQ(Sequence(), 0u);
}

TEST_F(LocalHazardCells, AHazardWhoseCourseCannotBeIsLeftOut) {
  protocol::CellNews news = NewsOf(kStreet, 0, 5, {There(1, kStreet, 3), There(2, kStreet, 4)});
  news.cells[0].hazards[0].course_rad = 7;
  news.cells[0].hazards[1].course_rad = -3;
  EXPECT_EQ(map_->Apply(news).unusable, 1U);
  EXPECT_EQ(map_->known_count(), 1U);
}

TEST_F(LocalHazardCells, ImpossibleWordsOfCellsCountForNothing) {
  protocol::CellNews::Hazard nowhere = There(2, East(100), 5);
  nowhere.position.latitude_deg = std::nan("");
  protocol::CellNews::Hazard nameless = There(3, East(100), 5);
  nameless.class_name.clear();
  protocol::CellNews::Hazard late = There(4, East(200), UINT64_MAX);
  const auto use = map_->Apply(NewsOf(kStreet, 0, 7, {nowhere, nameless, late}));
  EXPECT_EQ(use.unusable, 3u);
  EXPECT_EQ(map_->known_count(), 0u);
  EXPECT_EQ(Sequence(), 7u);
  EXPECT_TRUE(map_->Apply(NewsOf(kStreet, 7, UINT64_MAX, {})).known.empty());
  EXPECT_EQ(Sequence(), 7u);
}

}  // namespace
}  // namespace livemap::vehicle
