#include "zone/desk/desk_statistics.h"

#include <gtest/gtest.h>

namespace livemap::zone {
namespace {

constexpr std::int64_t kDeskDayNs = 86'400'000'000'000;
constexpr std::int64_t kDeskMonday = 19'674 * kDeskDayNs;  // 13 November 2023.

Hazard MakeSeen(std::uint8_t id, std::int64_t first_seen_ns,
                const std::string& class_name = "pothole") {
  Hazard hazard;
  hazard.uuid.bytes[0] = id;
  hazard.class_name = class_name;
  hazard.first_seen_ns = first_seen_ns;
  return hazard;
}

DecisionRecord MakeDecided(DecisionKind kind, const Hazard& hazard, std::int64_t at_ns) {
  DecisionRecord decision;
  decision.kind = kind;
  decision.subject = hazard.uuid.ToString();
  decision.at_ns = at_ns;
  return decision;
}

TEST(DeskStatistics, AWeekBeginsOnMonday) {
  EXPECT_EQ(WeekOf(kDeskMonday), kDeskMonday);
  EXPECT_EQ(WeekOf(kDeskMonday + 7 * kDeskDayNs - 1), kDeskMonday);
  EXPECT_EQ(WeekOf(kDeskMonday - 1), kDeskMonday - 7 * kDeskDayNs);
}

TEST(DeskStatistics, PrecisionIsOfTheNewestDecisionThatStands) {
  const Hazard one = MakeSeen(1, kDeskMonday);
  const Hazard two = MakeSeen(2, kDeskMonday);
  const Hazard three = MakeSeen(3, kDeskMonday);
  DeskStatistics statistics(0);
  DecisionRecord undone = MakeDecided(DecisionKind::kRejectHazard, three, kDeskMonday + 4);
  undone.undone_by = 9;
  statistics.AddDecision(undone);
  statistics.AddDecision(MakeDecided(DecisionKind::kConfirmHazard, three, kDeskMonday + 3));
  statistics.AddDecision(MakeDecided(DecisionKind::kConfirmHazard, two, kDeskMonday + 2));
  statistics.AddDecision(MakeDecided(DecisionKind::kRejectHazard, two, kDeskMonday + 1));
  statistics.AddDecision(MakeDecided(DecisionKind::kRejectHazard, one, kDeskMonday));
  for (const Hazard& hazard : {one, two, three}) statistics.AddHazard(hazard, "Forbes Ave");
  const DeskCounts& counts = statistics.by_class().at("pothole");
  EXPECT_EQ(counts.opened, 3U);
  EXPECT_EQ(counts.confirmed, 2U);
  EXPECT_EQ(counts.rejected, 1U);
  EXPECT_DOUBLE_EQ(*counts.Precision(), 2.0 / 3.0);
  EXPECT_EQ(statistics.by_street().at("Forbes Ave").opened, 3U);
}

TEST(DeskStatistics, NothingMeasuredIsNone) {
  DeskStatistics statistics(0);
  statistics.AddHazard(MakeSeen(1, kDeskMonday, "deer"), "");
  EXPECT_FALSE(statistics.by_class().at("deer").Precision());
  EXPECT_FALSE(statistics.by_class().at("deer").MedianRepairS());
}

TEST(DeskStatistics, TheTimeToRepairIsFromFirstSeenToTheRepairOfItsWeek) {
  DeskStatistics statistics(0);
  const Hazard one = MakeSeen(1, kDeskMonday);
  const Hazard two = MakeSeen(2, kDeskMonday);
  statistics.AddDecision(
      MakeDecided(DecisionKind::kCloseHazard, one, kDeskMonday + 8 * kDeskDayNs));
  statistics.AddDecision(
      MakeDecided(DecisionKind::kCloseHazard, two, kDeskMonday + 10 * kDeskDayNs));
  statistics.AddHazard(one, "");
  statistics.AddHazard(two, "");
  EXPECT_DOUBLE_EQ(*statistics.all().MedianRepairS(), 9 * 86400.0);
  EXPECT_EQ(statistics.by_week().at(kDeskMonday).opened, 2U);
  EXPECT_EQ(statistics.by_week().at(kDeskMonday + 7 * kDeskDayNs).repaired, 2U);
}

TEST(DeskStatistics, WhatHappenedBeforeThePeriodDoesNotCount) {
  DeskStatistics statistics(kDeskMonday);
  const Hazard old = MakeSeen(1, kDeskMonday - 1);
  statistics.AddDecision(MakeDecided(DecisionKind::kConfirmHazard, old, kDeskMonday - 1));
  statistics.AddHazard(old, "");
  EXPECT_EQ(statistics.all().opened, 0U);
  EXPECT_EQ(statistics.all().confirmed, 0U);
}

}  // namespace
}  // namespace livemap::zone
