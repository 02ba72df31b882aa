#include "zone/service/report_queue.h"

#include <gtest/gtest.h>

#include <thread>

#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

constexpr std::chrono::milliseconds kPatience{30000};

TEST(ReportQueue, GivesReportsInOrderAndAtMostTheLimit) {
  ReportQueue queue(10, 1000);
  std::vector<Uuid> uuids;
  for (int i = 0; i < 3; ++i) {
    const protocol::Report report = MakeReport();
    uuids.push_back(report.uuid);
    EXPECT_TRUE(queue.Push(report));
  }
  const auto first = queue.Take(2, kPatience);
  ASSERT_EQ(first.size(), 2U);
  EXPECT_EQ(first[0].uuid, uuids[0]);
  EXPECT_EQ(first[1].uuid, uuids[1]);
  EXPECT_EQ(queue.Take(2, kPatience).size(), 1U);
}

TEST(ReportQueue, TakesNoMoreThanItsBoundsAndRecovers) {
  ReportQueue queue(2, 1000);
  protocol::Report heavy = MakeReport();
  heavy.image = MakeJpeg(9, 9, 700);
  EXPECT_TRUE(queue.Push(heavy));
  EXPECT_FALSE(queue.Push(heavy));
  EXPECT_TRUE(queue.Push(MakeReport()));
  EXPECT_FALSE(queue.Push(MakeReport()));
  queue.Take(10, kPatience);
  EXPECT_TRUE(queue.Push(heavy));
}

TEST(ReportQueue, ClosingWakesTheTakerAndLeavesWhatIsThere) {
  ReportQueue queue(10, 1000);
  std::thread taker([&] { EXPECT_TRUE(queue.Take(10, kPatience).empty()); });
  queue.Close();
  taker.join();
  EXPECT_FALSE(queue.Push(MakeReport()));

  ReportQueue full(10, 1000);
  full.Push(MakeReport());
  full.Close();
  EXPECT_EQ(full.Take(10, kPatience).size(), 1U);
}

}  // namespace
}  // namespace livemap::zone
