#include "vehicle/outbox/resend_schedule.h"

#include <gmock/gmock.h>

#include "test/vehicle/reporting/known_reports.h"

namespace livemap::vehicle {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

ResendSchedule WithoutJitter() {
  ResendSchedule::Config config;
  config.jitter = 0;
  return ResendSchedule(config, std::mt19937_64(1));
}

TEST(ResendSchedule, PausesDoubleUpToTheLongest) {
  ResendSchedule schedule = WithoutJitter();
  schedule.Add(Id(1), 2, 0, 100.0);
  std::vector<double> sent_s;
  for (int tick = 0; tick < 1300; ++tick) {
    const double now_s = 100.0 + 0.125 * tick;
    if (!schedule.TakeDue(now_s, 10).empty()) sent_s.push_back(now_s - 100.0);
  }
  EXPECT_THAT(sent_s, ElementsAre(0, 1, 3, 7, 15, 31, 61, 91, 121, 151));
}

TEST(ResendSchedule, JitterVariesThePausesWithinItsBounds) {
  ResendSchedule schedule({1.0, 1.0, 0.2}, std::mt19937_64(7));
  schedule.Add(Id(1), 2, 0, 0.0);
  double last_s = 0, shortest_s = 10, longest_s = 0;
  schedule.TakeDue(0, 1);
  for (int tick = 1; tick < 500000; ++tick) {
    const double now_s = tick * 1e-3;
    if (schedule.TakeDue(now_s, 1).empty()) continue;
    shortest_s = std::min(shortest_s, now_s - last_s);
    longest_s = std::max(longest_s, now_s - last_s);
    last_s = now_s;
  }
  EXPECT_GE(shortest_s, 0.8 - 1e-6);
  EXPECT_LT(shortest_s, 0.85);
  EXPECT_LE(longest_s, 1.2 + 2e-3);
  EXPECT_GT(longest_s, 1.15);
}

TEST(ResendSchedule, UrgentGoesFirstThenTheOlder) {
  ResendSchedule schedule = WithoutJitter();
  schedule.Add(Id(1), 3, 10, 0.0);
  schedule.Add(Id(2), 1, 30, 0.0);
  schedule.Add(Id(3), 1, 20, 0.0);
  EXPECT_THAT(schedule.TakeDue(0.0, 2), ElementsAre(Id(3), Id(2)));
  EXPECT_THAT(schedule.TakeDue(0.0, 2), ElementsAre(Id(1)));
  EXPECT_THAT(schedule.TakeDue(0.0, 2), IsEmpty());
}

TEST(ResendSchedule, FinishedReportIsNotSentAgain) {
  ResendSchedule schedule = WithoutJitter();
  schedule.Add(Id(1), 3, 10, 0.0);
  schedule.Remove(Id(1));
  schedule.Remove(Id(2));
  EXPECT_THAT(schedule.TakeDue(100.0, 10), IsEmpty());
  EXPECT_EQ(schedule.size(), 0u);
}

std::vector<Uuid> SendUntil(ResendSchedule& schedule, double from_s, double to_s) {
  std::vector<Uuid> sent;
  for (double now_s = from_s; now_s <= to_s; now_s += 0.125) {
    for (const Uuid& id : schedule.TakeDue(now_s, 10)) sent.push_back(id);
  }
  return sent;
}

TEST(ResendSchedule, FirstAnswerAfterASilenceEndsTheLongPausesOfAll) {
  ResendSchedule schedule = WithoutJitter();
  for (const int id : {1, 2, 3}) schedule.Add(Id(id), 2, id, 0.0);
  SendUntil(schedule, 0.0, 16.0);  // Sent at 0, 1, 3, 7, 15 s; due again at 31 s.
  schedule.Remove(Id(1));
  EXPECT_THAT(schedule.TakeDue(16.125, 10), ElementsAre(Id(2), Id(3)));
  EXPECT_THAT(SendUntil(schedule, 16.25, 17.0), IsEmpty());
  EXPECT_THAT(SendUntil(schedule, 17.125, 17.125), ElementsAre(Id(2), Id(3)));
}

TEST(ResendSchedule, AnswersThatFollowEachOtherLeaveThePausesAlone) {
  ResendSchedule schedule = WithoutJitter();
  for (const int id : {1, 2, 3, 4}) schedule.Add(Id(id), 2, id, 0.0);
  SendUntil(schedule, 0.0, 0.0);
  schedule.Remove(Id(1));
  SendUntil(schedule, 0.125, 1.5);  // All again at 1 s, then at 3 s.
  schedule.Remove(Id(2));
  EXPECT_THAT(SendUntil(schedule, 1.625, 2.875), IsEmpty());
  EXPECT_THAT(SendUntil(schedule, 3.0, 3.0), ElementsAre(Id(3), Id(4)));
}

TEST(ResendSchedule, WhatWasSentAMomentAgoIsNotSentAtOnceAgainByAnAnswer) {
  ResendSchedule schedule = WithoutJitter();
  schedule.Add(Id(1), 2, 1, 0.0);
  schedule.Add(Id(2), 2, 2, 0.0);
  SendUntil(schedule, 0.0, 7.0);  // Due again at 15 s.
  schedule.Remove(Id(1));
  EXPECT_THAT(SendUntil(schedule, 7.125, 7.875), IsEmpty());
  EXPECT_THAT(SendUntil(schedule, 8.0, 8.0), ElementsAre(Id(2)));
}

TEST(ResendSchedule, TheOldestReportIsTheOneThatWasMadeFirst) {
  ResendSchedule schedule = WithoutJitter();
  EXPECT_EQ(schedule.OldestNs(), std::nullopt);
  schedule.Add(Id(1), 3, 20, 0.0);
  schedule.Add(Id(2), 1, 10, 0.0, 100.0);
  EXPECT_EQ(schedule.OldestNs(), 10);
  schedule.Remove(Id(2));
  EXPECT_EQ(schedule.OldestNs(), 20);
}

TEST(ResendSchedule, AHeldReportWaitsForACheapLinkOrTheEndOfItsTime) {
  ResendSchedule schedule = WithoutJitter();
  schedule.SetCheapLink(false);
  schedule.Add(Id(1), 3, 1, 0.0, 100.0);
  schedule.Add(Id(2), 3, 2, 0.0, 200.0);
  schedule.Add(Id(3), 1, 3, 0.0);
  EXPECT_THAT(schedule.TakeDue(0.0, 10), ElementsAre(Id(3)));
  schedule.Remove(Id(3));
  EXPECT_EQ(schedule.Held(0.0), 2u);
  EXPECT_THAT(SendUntil(schedule, 0.125, 99.875), IsEmpty());
  EXPECT_THAT(schedule.TakeDue(100.0, 10), ElementsAre(Id(1)));
  schedule.Remove(Id(1));
  schedule.SetCheapLink(true);
  EXPECT_THAT(schedule.TakeDue(101.0, 10), ElementsAre(Id(2)));
  schedule.SetCheapLink(false);
  EXPECT_THAT(SendUntil(schedule, 101.0, 199.0), IsEmpty()) << "the link is dear again";
  EXPECT_THAT(schedule.TakeDue(200.0, 10), ElementsAre(Id(2)));
}

TEST(ResendSchedule, RemembersWhatWasSentUntilItIsFinished) {
  ResendSchedule schedule = WithoutJitter();
  schedule.Add(Id(1), 3, 1, 0.0);
  schedule.Add(Id(2), 3, 2, 0.0, 0.0, /*was_sent=*/true);
  EXPECT_THAT(schedule.TakeDue(0.0, 10), ElementsAre(Id(1), Id(2)));
  EXPECT_FALSE(schedule.WasSent(Id(1))) << "due, but nobody has said that it went";
  EXPECT_TRUE(schedule.WasSent(Id(2)));
  schedule.MarkSent(Id(1));
  EXPECT_TRUE(schedule.WasSent(Id(1)));
  schedule.Remove(Id(1));
  schedule.MarkSent(Id(1));
  EXPECT_FALSE(schedule.WasSent(Id(1)));
  EXPECT_EQ(schedule.size(), 1u);
}

}  // namespace
}  // namespace livemap::vehicle
