#include "web/server/work_queue.h"

#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <string>
#include <vector>

namespace livemap::web {
namespace {

using Rank = WorkQueue::Rank;

/// The only thread stands still in a first job until the test lets it go.
class WorkQueueTest : public testing::Test {
 protected:
  void SetUp() override {
    queue_.Post("first", Rank::kReader, [this] {
      begun_.set_value();
      release_.get_future().wait();
    });
    begun_.get_future().wait();
  }
  void Post(const std::string& client, Rank rank, const std::string& name) {
    queue_.Post(client, rank, [this, name] { done_.push_back(name); });
  }
  /// What was done, in order, when all is.
  std::vector<std::string> Finish() {
    std::promise<void> last;
    // A client whose turn comes last, behind the longest line.
    for (int i = 0; i < 100; ++i) queue_.Post("z", Rank::kReader, [] {});
    queue_.Post("z", Rank::kReader, [&last] { last.set_value(); });
    release_.set_value();
    last.get_future().wait();
    return done_;
  }

  std::promise<void> begun_;
  std::promise<void> release_;
  std::vector<std::string> done_;  ///< The queue's thread alone.
  WorkQueue queue_{1};
};

TEST_F(WorkQueueTest, ClientsTakeTurnsHoweverMuchOneAsksFor) {
  for (const char* name : {"a1", "a2", "a3"}) Post("a", Rank::kReader, name);
  Post("b", Rank::kReader, "b1");
  EXPECT_EQ(Finish(), (std::vector<std::string>{"a1", "b1", "a2", "a3"}));
}

TEST_F(WorkQueueTest, AnOfficialsJobGoesFirst) {
  for (const char* name : {"a1", "a2"}) Post("a", Rank::kReader, name);
  Post("a", Rank::kOfficial, "official");
  EXPECT_EQ(Finish(), (std::vector<std::string>{"official", "a1", "a2"}));
}

TEST_F(WorkQueueTest, AJobThatGoesOnLetsOthersTakeTheirTurn) {
  queue_.Post("a", Rank::kReader, [this] {
    done_.push_back("a1");
    Post("a", Rank::kReader, "a2");
  });
  Post("b", Rank::kReader, "b1");
  EXPECT_EQ(Finish(), (std::vector<std::string>{"a1", "b1", "a2"}));
}

TEST_F(WorkQueueTest, WhatWaitsIsDroppedWithoutACall) {
  const auto held = std::make_shared<int>(0);
  queue_.Post("a", Rank::kReader, [held] { ++*held; });
  release_.set_value();
  queue_.Stop();
  queue_.Post("a", Rank::kReader, [held] { *held = 100; });
  EXPECT_LE(*held, 1);
  EXPECT_EQ(held.use_count(), 1);
}

}  // namespace
}  // namespace livemap::web
