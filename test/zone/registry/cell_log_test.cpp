#include "zone/registry/cell_log.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace livemap::zone {
namespace {

constexpr std::size_t kLimit = 1000;

Uuid CellHazardId(std::uint8_t number) {
  Uuid uuid;
  uuid.bytes[15] = number;
  return uuid;
}

/// On both sides of the edge between two cells.
struct Border {
  Border() {
    // Eastwards until the cell is another one.
    for (double away_deg = 0;; away_deg += 1e-5) {
      const geo::GeoPoint point{48.1, 11.5 + away_deg};
      if (geo::MapCell::At(point) != geo::MapCell::At({48.1, 11.5})) {
        west = {48.1, point.longitude_deg - 2e-5};
        east = point;
        return;
      }
    }
  }
  geo::GeoPoint west, east;
};

TEST(CellLogTest, AnAnnouncementNamesTheOneBeforeItInItsCell) {
  CellLog log(0);
  const geo::GeoPoint here{48.1, 11.5};
  const geo::GeoPoint far{48.3, 11.5};
  EXPECT_EQ(log.Announce(CellHazardId(1), here, true, 3).front().previous, 0U);
  EXPECT_EQ(log.Announce(CellHazardId(2), far, true, 4).front().previous, 0U);
  const auto steps = log.Announce(CellHazardId(3), here, true, 7);
  ASSERT_EQ(steps.size(), 1U);
  EXPECT_EQ(steps.front().cell, geo::MapCell::At(here));
  EXPECT_EQ(steps.front().previous, 3U);
  EXPECT_FALSE(steps.front().leaves);
}

TEST(CellLogTest, WhoKnowsNothingOfACellIsToldWhatIsThere) {
  CellLog log(0);
  const geo::GeoPoint here{48.1, 11.5};
  log.Announce(CellHazardId(1), here, true, 1);
  log.Announce(CellHazardId(2), here, true, 2);
  log.Announce(CellHazardId(1), here, false, 3);
  log.Announce(CellHazardId(3), {48.3, 11.5}, true, 4);
  const auto news = log.Since(geo::MapCell::At(here), 0, kLimit);
  EXPECT_TRUE(news.is_whole);
  EXPECT_EQ(news.sequence, 4U);
  EXPECT_EQ(news.there, std::vector<Uuid>{CellHazardId(2)});
  EXPECT_TRUE(news.gone.empty());
}

TEST(CellLogTest, WhoKnowsACellIsToldWhatChangedSince) {
  CellLog log(0);
  const geo::GeoPoint here{48.1, 11.5};
  log.Announce(CellHazardId(1), here, true, 1);
  log.Announce(CellHazardId(2), here, true, 2);
  log.Announce(CellHazardId(3), here, true, 3);
  log.Announce(CellHazardId(2), here, false, 4);
  log.Announce(CellHazardId(1), here, true, 5);
  const auto news = log.Since(geo::MapCell::At(here), 3, kLimit);
  EXPECT_FALSE(news.is_whole);
  EXPECT_EQ(news.there, std::vector<Uuid>{CellHazardId(1)});
  ASSERT_EQ(news.gone.size(), 1U);
  EXPECT_EQ(news.gone.front().first, CellHazardId(2));
  EXPECT_EQ(news.gone.front().second, 4U);
  const auto nothing = log.Since(geo::MapCell::At(here), 5, kLimit);
  EXPECT_FALSE(nothing.is_whole);
  EXPECT_TRUE(nothing.there.empty());
  EXPECT_TRUE(nothing.gone.empty());
}

TEST(CellLogTest, AHazardThatCrossesAnEdgeLeavesOneCellAndComesIntoTheOther) {
  const Border border;
  const geo::MapCell west = geo::MapCell::At(border.west);
  const geo::MapCell east = geo::MapCell::At(border.east);
  CellLog log(0);
  log.Announce(CellHazardId(9), border.east, true, 1);
  log.Announce(CellHazardId(1), border.west, true, 2);
  const auto steps = log.Announce(CellHazardId(1), border.east, true, 5);
  ASSERT_EQ(steps.size(), 2U);
  EXPECT_EQ(steps[0].cell, west);
  EXPECT_EQ(steps[0].previous, 2U);
  EXPECT_TRUE(steps[0].leaves);
  EXPECT_EQ(steps[1].cell, east);
  EXPECT_EQ(steps[1].previous, 1U);
  EXPECT_FALSE(steps[1].leaves);
  EXPECT_EQ(log.Since(west, 2, kLimit).gone.size(), 1U);
  EXPECT_TRUE(log.Since(west, 0, kLimit).there.empty());
  EXPECT_EQ(log.Since(east, 2, kLimit).there, std::vector<Uuid>{CellHazardId(1)});
}

TEST(CellLogTest, AHazardThatIsRemovedIsRemovedWhereItWasKnown) {
  const Border border;
  CellLog log(0);
  log.Announce(CellHazardId(1), border.west, true, 1);
  const auto steps = log.Announce(CellHazardId(1), border.east, false, 2);
  ASSERT_EQ(steps.size(), 1U);
  EXPECT_EQ(steps.front().cell, geo::MapCell::At(border.west));
  EXPECT_TRUE(steps.front().leaves);
  EXPECT_EQ(log.size(), 0U);
}

TEST(CellLogTest, WhoKnowsACellFromBeforeTheStartIsToldAllOfIt) {
  const geo::GeoPoint here{48.1, 11.5};
  const geo::MapCell cell = geo::MapCell::At(here);
  CellLog log(10);
  log.Restore(CellHazardId(1), here, 4);
  EXPECT_TRUE(log.Since(cell, 9, kLimit).is_whole);
  EXPECT_EQ(log.Since(cell, 9, kLimit).there.size(), 1U);
  EXPECT_FALSE(log.Since(cell, 10, kLimit).is_whole);
  EXPECT_EQ(log.Announce(CellHazardId(2), here, true, 11).front().previous, 10U);
  EXPECT_EQ(log.Announce(CellHazardId(3), here, true, 12).front().previous, 11U);
  EXPECT_EQ(log.Announce(CellHazardId(4), {1, 1}, true, 13).front().previous, 10U);
}

TEST(CellLogTest, WhoKnowsMoreThanWasAnnouncedIsToldAllOfIt) {
  const geo::GeoPoint here{48.1, 11.5};
  CellLog log(10);
  log.Restore(CellHazardId(1), here, 4);
  const auto news = log.Since(geo::MapCell::At(here), 11, kLimit);
  EXPECT_TRUE(news.is_whole);
  EXPECT_EQ(news.sequence, 10U);
}

TEST(CellLogTest, WhatWasRemovedLongAgoIsForgottenAndTheWholeCellTold) {
  const geo::GeoPoint here{48.1, 11.5};
  const geo::MapCell cell = geo::MapCell::At(here);
  CellLog log(0);
  std::uint64_t sequence = 0;
  for (std::size_t i = 0; i <= CellLog::kMaxGone; ++i) {
    log.Announce(CellHazardId(1), here, true, ++sequence);
    log.Announce(CellHazardId(1), here, false, ++sequence);
  }
  EXPECT_TRUE(log.Since(cell, 1, kLimit).is_whole);
  EXPECT_FALSE(log.Since(cell, 2, kLimit).is_whole);
  EXPECT_EQ(log.Since(cell, 2, kLimit).gone.size(), CellLog::kMaxGone);
}

TEST(CellLogTest, AtMostTheLimitIsToldTheNewestFirst) {
  const geo::GeoPoint here{48.1, 11.5};
  const geo::MapCell cell = geo::MapCell::At(here);
  CellLog log(0);
  for (std::uint8_t i = 1; i <= 10; ++i) log.Announce(CellHazardId(i), here, true, i);
  const auto news = log.Since(cell, 2, 3);
  EXPECT_TRUE(news.is_whole);
  EXPECT_EQ(news.there, (std::vector<Uuid>{CellHazardId(10), CellHazardId(9), CellHazardId(8)}));
}

TEST(CellLogTest, OfACellWithoutHazardsNothingIsTold) {
  CellLog log(10);
  const geo::MapCell cell = geo::MapCell::At({1, 1});
  EXPECT_TRUE(log.Since(cell, 0, kLimit).is_whole);
  EXPECT_FALSE(log.Since(cell, 10, kLimit).is_whole);
  EXPECT_EQ(log.Since(cell, 0, kLimit).sequence, 10U);
}

}  // namespace
}  // namespace livemap::zone
