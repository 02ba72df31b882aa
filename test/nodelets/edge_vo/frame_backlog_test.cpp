#include "nodelets/edge_vo/frame_backlog.h"

#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/time.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "nodelets/guarded_queue.h"

namespace livemap::nodelets {
namespace {

/// A message of the node's queue.
class Message : public ros::CallbackInterface {
 public:
  explicit Message(std::function<void()> handle) : handle_(std::move(handle)) {}
  CallResult call() override {
    handle_();
    return Success;
  }

 private:
  const std::function<void()> handle_;
};

class FrameBacklogTest : public ::testing::Test {
 protected:
  void SetUp() override { ros::Time::init(); }  // The log asks for it.
  void Come(std::function<void()> handle) {
    queue_.addCallback(boost::make_shared<Message>(std::move(handle)), 1);
  }
  /// One frame per message, as a camera sends them.
  void Send(int first, int last) {
    for (int frame = first; frame <= last; ++frame) {
      Come([this, frame] { backlog_->Push(frame); });
    }
  }
  void WorkAll() {
    while (!queue_.isEmpty()) queue_.callOne();
  }

  ros::CallbackQueue queue_;
  GuardedQueue guarded_{"edge_vo", queue_};  // As a nodelet's.
  std::vector<int> worked_;
  std::unique_ptr<FrameBacklog<int>> backlog_ = std::make_unique<FrameBacklog<int>>(
      3, guarded_, [this](int frame) { worked_.push_back(frame); });
};

TEST_F(FrameBacklogTest, FramesThatComeSlowlyAreAllWorkedOnInTheirOrder) {
  for (int frame = 1; frame <= 5; ++frame) {
    Send(frame, frame);
    WorkAll();
  }
  EXPECT_EQ(worked_, (std::vector<int>{1, 2, 3, 4, 5}));
  EXPECT_EQ(backlog_->displaced(), 0U);
}

TEST_F(FrameBacklogTest, MessagesThatHaveComeAreHandledBeforeTheFrames) {
  bool handled = false;
  Send(1, 1);
  Come([&] {
    handled = true;
    EXPECT_TRUE(worked_.empty());
  });
  WorkAll();
  EXPECT_TRUE(handled);
  EXPECT_EQ(worked_, (std::vector<int>{1}));
}

TEST_F(FrameBacklogTest, BeyondItsCapacityTheOldestGoAndEachIsAccountedFor) {
  Send(1, 10);
  WorkAll();
  EXPECT_EQ(worked_, (std::vector<int>{8, 9, 10}));
  EXPECT_EQ(backlog_->in(), 10U);
  EXPECT_EQ(backlog_->displaced(), 7U);
  EXPECT_EQ(backlog_->waiting(), 0U);
}

TEST_F(FrameBacklogTest, WorkSlowerThanTheCameraNeverFallsFurtherBehind) {
  int sent = 0, oldest = 0;
  const auto send_four = [&] {
    Send(sent + 1, sent + 4);
    sent += 4;
  };
  backlog_ = std::make_unique<FrameBacklog<int>>(3, guarded_, [&](int frame) {
    worked_.push_back(frame);
    oldest = std::max(oldest, sent - frame);
    if (sent < 100) send_four();  // While one is worked on.
  });
  send_four();
  WorkAll();
  EXPECT_EQ(oldest, 2);  // Those that wait behind it.
  EXPECT_GT(worked_.size(), 20U);
  EXPECT_EQ(backlog_->in(), worked_.size() + backlog_->displaced());
}

TEST_F(FrameBacklogTest, WhatWaitsIsDisplacedWhenItIsCleared) {
  Send(1, 2);
  Come([this] { backlog_->Clear(); });
  Send(3, 3);
  WorkAll();
  EXPECT_EQ(worked_, (std::vector<int>{3}));
  EXPECT_EQ(backlog_->displaced(), 2U);
}

TEST_F(FrameBacklogTest, AnErrorOfTheWorkKeepsTheNextFramesTheirTurn) {
  backlog_ = std::make_unique<FrameBacklog<int>>(3, guarded_, [&](int frame) {
    if (frame == 1) throw std::runtime_error("an unusable frame");
    worked_.push_back(frame);
  });
  Send(1, 2);
  WorkAll();
  EXPECT_EQ(worked_, (std::vector<int>{2}));
}

TEST_F(FrameBacklogTest, NothingIsWorkedOnAfterItsEnd) {
  Send(1, 1);
  queue_.callOne();
  EXPECT_EQ(backlog_->waiting(), 1U);
  backlog_.reset();
  EXPECT_TRUE(queue_.isEmpty());
}

}  // namespace
}  // namespace livemap::nodelets
