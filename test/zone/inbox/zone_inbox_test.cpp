#include "zone/inbox/zone_inbox.h"

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <thread>

#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

constexpr std::chrono::milliseconds kPatience{30000};

ZoneInbox::Config Limits(std::size_t max_reports, std::size_t batch) {
  ZoneInbox::Config config;
  config.max_reports = max_reports;
  config.max_bytes = 1000;
  config.max_map_changes = 2;
  config.max_answers = 2;
  config.batch = batch;
  return config;
}

protocol::PollAnswer AnswerOf(const std::string& vehicle) {
  protocol::PollAnswer answer;
  answer.vehicle_id = vehicle;
  return answer;
}

TEST(ZoneInbox, GivesReportsInOrderAndAtMostABatch) {
  ZoneInbox inbox(Limits(10, 2));
  std::vector<Uuid> uuids;
  for (int i = 0; i < 3; ++i) {
    const protocol::Report report = MakeReport();
    uuids.push_back(report.uuid);
    EXPECT_TRUE(inbox.Push(report));
  }
  EXPECT_EQ(inbox.reports(), 3U);
  const auto first = inbox.Take(kPatience).reports;
  ASSERT_EQ(first.size(), 2U);
  EXPECT_EQ(first[0].uuid, uuids[0]);
  EXPECT_EQ(first[1].uuid, uuids[1]);
  EXPECT_EQ(inbox.Take(kPatience).reports.size(), 1U);
}

TEST(ZoneInbox, TakesNoMoreReportsThanItsBoundsAndRecovers) {
  ZoneInbox inbox(Limits(2, 10));
  protocol::Report heavy = MakeReport();
  heavy.image = MakeJpeg(9, 9, 700);
  EXPECT_TRUE(inbox.Push(heavy));
  EXPECT_FALSE(inbox.Push(heavy));
  EXPECT_TRUE(inbox.Push(MakeReport()));
  EXPECT_FALSE(inbox.Push(MakeReport()));
  inbox.Take(kPatience);
  EXPECT_TRUE(inbox.Push(heavy));
}

TEST(ZoneInbox, MapChangesAreBoundedAndTakenInBatches) {
  ZoneInbox inbox(Limits(10, 1));
  EXPECT_TRUE(inbox.Push(protocol::MapChangeReport()));
  EXPECT_TRUE(inbox.Push(protocol::MapChangeReport()));
  EXPECT_FALSE(inbox.Push(protocol::MapChangeReport()));
  EXPECT_EQ(inbox.map_changes(), 2U);
  EXPECT_EQ(inbox.Take(kPatience).map_changes.size(), 1U);
  EXPECT_EQ(inbox.Take(kPatience).map_changes.size(), 1U);
}

TEST(ZoneInbox, TheOldestAnswerMakesRoomForTheNewest) {
  ZoneInbox inbox(Limits(10, 1));
  EXPECT_TRUE(inbox.Push(AnswerOf("a")));
  EXPECT_TRUE(inbox.Push(AnswerOf("b")));
  EXPECT_FALSE(inbox.Push(AnswerOf("c")));
  const auto answers = inbox.Take(kPatience).answers;
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(answers[0].vehicle_id, "b");
  EXPECT_EQ(answers[1].vehicle_id, "c");
}

TEST(ZoneInbox, WhateverArrivesWakesTheWorkerAtOnce) {
  const std::function<void(ZoneInbox&)> arrivals[] = {
      [](ZoneInbox& inbox) { inbox.Push(MakeReport()); },
      [](ZoneInbox& inbox) { inbox.Push(protocol::MapChangeReport()); },
      [](ZoneInbox& inbox) { inbox.Push(AnswerOf("a")); },
      [](ZoneInbox& inbox) { inbox.Push(CatchUpOrder()); }};
  for (const auto& arrive : arrivals) {
    ZoneInbox inbox(Limits(10, 10));
    const auto start = std::chrono::steady_clock::now();
    std::thread worker([&] { EXPECT_FALSE(inbox.Take(kPatience).empty()); });
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    arrive(inbox);
    worker.join();
    EXPECT_LT(std::chrono::steady_clock::now() - start, kPatience / 2);
  }
}

TEST(ZoneInbox, ClosingWakesTheWorkerAndLeavesWhatIsThere) {
  ZoneInbox inbox(Limits(10, 10));
  std::thread worker([&] { EXPECT_TRUE(inbox.Take(kPatience).empty()); });
  inbox.Close();
  worker.join();
  EXPECT_TRUE(inbox.closed());
  EXPECT_FALSE(inbox.Push(MakeReport()));
  EXPECT_FALSE(inbox.Push(protocol::MapChangeReport()));
  EXPECT_FALSE(inbox.Push(AnswerOf("a")));

  ZoneInbox full(Limits(10, 10));
  full.Push(MakeReport());
  full.Push(AnswerOf("a"));
  full.Close();
  const ZoneInbox::Batch left = full.Take(kPatience);
  EXPECT_EQ(left.reports.size(), 1U);
  EXPECT_EQ(left.answers.size(), 1U);
}

}  // namespace
}  // namespace livemap::zone
