#include "common/queues/frame_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace livemap {
namespace {

using ::testing::ElementsAre;

TEST(FrameQueue, HandsItemsOnInTheirOrder) {
  FrameQueue<int> queue(3);
  for (int i = 1; i <= 3; ++i) queue.Push(i);
  std::vector<int> taken;
  for (int i = 0; i < 3; ++i) taken.push_back(queue.Pop().value());
  EXPECT_THAT(taken, ElementsAre(1, 2, 3));
}

TEST(FrameQueue, DropsTheOldestWhenFullAndCountsIt) {
  FrameQueue<int> queue(2);
  for (int i = 1; i <= 5; ++i) queue.Push(i);
  EXPECT_EQ(queue.Pop().value(), 4);
  queue.Done();
  EXPECT_EQ(queue.Pop().value(), 5);
  queue.Unusable();
  const auto counters = queue.counters();
  EXPECT_EQ(counters.in, 5U);
  EXPECT_EQ(counters.processed, 1U);
  EXPECT_EQ(counters.dropped, 4U);
  EXPECT_EQ(counters.waiting, 0U);
}

TEST(FrameQueue, AnItemInWorkCountsAsWaiting) {
  FrameQueue<int> queue(2);
  queue.Push(1);
  EXPECT_EQ(queue.counters().waiting, 1U);
  queue.Pop();
  EXPECT_EQ(queue.counters().waiting, 1U);
  queue.Done();
  EXPECT_EQ(queue.counters().waiting, 0U);
}

TEST(FrameQueue, ClosingWakesTheWorkerAndCountsWhatWaited) {
  FrameQueue<int> queue(2);
  std::thread worker([&queue] { EXPECT_FALSE(queue.Pop().has_value()); });
  queue.Close();
  worker.join();
  queue.Push(1);
  EXPECT_EQ(queue.counters().in, 0U);
}

TEST(FrameQueue, EveryItemIsAccountedForAtAnyMomentUnderLoad) {
  FrameQueue<int> queue(3);
  std::atomic<bool> balanced{true};
  const auto check = [&] {
    const auto counters = queue.counters();
    if (counters.in != counters.processed + counters.dropped + counters.waiting) balanced = false;
  };
  std::thread worker([&] {
    while (queue.Pop()) queue.Done();
  });
  for (int i = 0; i < 20000; ++i) {
    queue.Push(i);
    check();
  }
  while (queue.counters().waiting != 0) std::this_thread::yield();
  queue.Close();
  worker.join();
  check();
  EXPECT_TRUE(balanced);
  EXPECT_EQ(queue.counters().in, 20000U);
}

}  // namespace
}  // namespace livemap
