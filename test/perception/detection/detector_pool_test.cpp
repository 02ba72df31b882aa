#include "perception/detection/detector_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace livemap::perception {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using Pool = DetectorPool<int, int>;

/// Collects what the pool hands on; read only after the pool is closed or Await has returned.
class Received {
 public:
  Pool::OnOutcome Taker() {
    return [this](const Pool::Outcome& outcome) {
      const std::lock_guard<std::mutex> lock(mutex_);
      items_.push_back(outcome.item);
      if (outcome.result) results_.push_back(*outcome.result);
      if (!outcome.error.empty()) errors_.push_back(outcome.error);
      changed_.notify_all();
    };
  }
  /// Whether `count` items came within ten seconds.
  bool Await(std::size_t count) {
    std::unique_lock<std::mutex> lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(10),
                             [&] { return items_.size() >= count; });
  }
  std::vector<int> items() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return items_;
  }
  std::vector<int> results() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return results_;
  }
  std::vector<std::string> errors() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return errors_;
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<int> items_;
  std::vector<int> results_;
  std::vector<std::string> errors_;
};

bool Balanced(const Pool::Counters& counters) {
  return counters.in == counters.processed + counters.dropped + counters.waiting;
}

/// A gate that holds an engine until it is opened.
class Gate {
 public:
  void Open() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      open_ = true;
    }
    changed_.notify_all();
  }
  void Pass() {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return open_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool open_ = false;
};

TEST(DetectorPool, UnevenEnginesAnswerInTheOrderOfTheFrames) {
  Received received;
  std::atomic<int> by_slow{0};
  std::atomic<int> by_fast{0};
  const auto engine = [](std::atomic<int>& count, int slowest_ms) {
    return [&count, slowest_ms](const int& frame, std::size_t) {
      // Uneven between the engines and from frame to frame.
      std::this_thread::sleep_for(milliseconds(1 + (frame * 7) % slowest_ms));
      ++count;
      return 10 * frame;
    };
  };
  Pool pool({engine(by_slow, 12), engine(by_fast, 3), engine(by_fast, 2)}, 200, received.Taker());
  std::vector<int> frames;
  std::vector<int> answers;
  for (int frame = 0; frame < 200; ++frame) {
    frames.push_back(frame);
    answers.push_back(10 * frame);
    pool.Push(frame);
  }
  ASSERT_TRUE(received.Await(200));
  pool.Close();
  EXPECT_EQ(received.items(), frames);
  EXPECT_EQ(received.results(), answers);
  EXPECT_GT(by_slow, 0);
  EXPECT_GT(by_fast, by_slow) << "an idle engine takes the next frame";
  EXPECT_EQ(pool.counters().processed, 200U);
  EXPECT_EQ(pool.counters().dropped, 0U);
}

TEST(DetectorPool, DropsNothingWhileTheEnginesTogetherKeepUp) {
  // Frames each 20 ms; engines of 30 ms on average (5 to 55): one alone would lose a third, two
  // have a quarter to spare.
  Received received;
  const auto engine = [](const int& frame, std::size_t) {
    std::this_thread::sleep_for(milliseconds(frame % 2 == 0 ? 5 : 55));
    return frame;
  };
  Pool pool({engine, engine}, 10, received.Taker());
  for (int frame = 0; frame < 60; ++frame) {
    pool.Push(frame);
    std::this_thread::sleep_for(milliseconds(20));
  }
  ASSERT_TRUE(received.Await(60));
  pool.Close();
  EXPECT_EQ(pool.counters().dropped, 0U);
}

TEST(DetectorPool, BeyondThatTheOldestWaitingFramesGoAndAreCounted) {
  Received received;
  Gate gate;
  std::atomic<int> started{0};
  const auto engine = [&](const int& frame, std::size_t) {
    ++started;
    gate.Pass();
    return frame;
  };
  Pool pool({engine, engine}, 2, received.Taker());
  pool.Push(0);
  pool.Push(1);
  while (started < 2) std::this_thread::yield();
  for (int frame = 2; frame < 10; ++frame) pool.Push(frame);
  EXPECT_EQ(pool.counters().dropped, 6U);
  EXPECT_EQ(pool.counters().waiting, 4U) << "two in work, two in the queue";
  EXPECT_TRUE(Balanced(pool.counters()));
  gate.Open();
  ASSERT_TRUE(received.Await(4));
  pool.Close();
  EXPECT_THAT(received.items(), ElementsAre(0, 1, 8, 9));
}

TEST(DetectorPool, TellsAnEngineHowManyWaitBehindItsItem) {
  Received received;
  Gate gate;
  std::atomic<int> started{0};
  Pool pool({[&](const int&, std::size_t waiting) {
              ++started;
              gate.Pass();
              return static_cast<int>(waiting);
            }},
            10, received.Taker());
  pool.Push(0);
  while (started < 1) std::this_thread::yield();
  for (int frame = 1; frame < 4; ++frame) pool.Push(frame);
  gate.Open();
  ASSERT_TRUE(received.Await(4));
  pool.Close();
  EXPECT_THAT(received.results(), ElementsAre(0, 2, 1, 0));
}

TEST(DetectorPool, AnEngineThatThrowsDoesNotStallTheOthersNorTheOrder) {
  Received received;
  const auto engine = [](const int& frame, std::size_t) {
    std::this_thread::sleep_for(milliseconds((frame * 5) % 7));
    if (frame % 3 == 1) throw std::runtime_error("frame " + std::to_string(frame));
    if (frame == 5) throw 5;
    return frame;
  };
  Pool pool({engine, engine}, 10, received.Taker());
  for (int frame = 0; frame < 9; ++frame) pool.Push(frame);
  ASSERT_TRUE(received.Await(9));
  pool.Close();
  EXPECT_THAT(received.items(), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8));
  EXPECT_THAT(received.results(), ElementsAre(0, 2, 3, 6, 8));
  EXPECT_THAT(received.errors(),
              ElementsAre("frame 1", "frame 4", "an exception of another kind", "frame 7"));
  EXPECT_EQ(pool.counters().processed, 5U);
  EXPECT_EQ(pool.counters().dropped, 4U);
}

TEST(DetectorPool, ACallbackThatThrowsCountsItsFrameAsDropped) {
  std::atomic<int> called{0};
  Pool pool({[](const int& frame, std::size_t) { return frame; }}, 10,
            [&](const Pool::Outcome& outcome) {
              ++called;
              if (outcome.item == 1) throw std::runtime_error("no");
            });
  for (int frame = 0; frame < 3; ++frame) pool.Push(frame);
  while (called < 3 || pool.counters().waiting > 0) std::this_thread::yield();
  EXPECT_EQ(pool.counters().processed, 2U);
  EXPECT_EQ(pool.counters().dropped, 1U);
}

TEST(DetectorPool, EnginesRunAheadOfAHangingOneOnlyByTheQueuesSize) {
  Received received;
  Gate gate;
  std::atomic<int> hung{0};
  std::atomic<int> worked{0};
  const auto engine = [&](const int& frame, std::size_t) {
    if (frame == 0) {
      ++hung;
      gate.Pass();
    }
    ++worked;
    return frame;
  };
  Pool pool({engine, engine}, 3, received.Taker());
  pool.Push(0);
  while (hung == 0) std::this_thread::yield();
  for (int frame = 1; frame <= 20; ++frame) {
    pool.Push(frame);
    std::this_thread::sleep_for(milliseconds(2));
  }
  EXPECT_LE(worked, 4) << "one engine's worth and the queue's size";
  EXPECT_TRUE(received.items().empty());
  EXPECT_TRUE(Balanced(pool.counters()));
  gate.Open();
  while (pool.counters().waiting > 0) std::this_thread::yield();
  pool.Close();
  EXPECT_EQ(received.items().front(), 0);
  EXPECT_EQ(received.items().back(), 20);
  EXPECT_EQ(pool.counters().processed + pool.counters().dropped, 21U);
}

TEST(DetectorPool, ClosingEndsAtOnceAndCountsWhatWaited) {
  Received received;
  const auto engine = [](const int& frame, std::size_t) {
    std::this_thread::sleep_for(milliseconds(20));
    return frame;
  };
  Pool pool({engine}, 100, received.Taker());
  for (int frame = 0; frame < 100; ++frame) pool.Push(frame);
  pool.Close();
  EXPECT_LT(received.items().size(), 50U);
  EXPECT_EQ(pool.counters().waiting, 0U);
  EXPECT_TRUE(Balanced(pool.counters()));
  pool.Push(1);
  EXPECT_EQ(pool.counters().in, 100U) << "closed";
}

TEST(DetectorPool, EveryFrameIsAccountedForAtAnyMomentUnderLoadFromSeveralThreads) {
  Received received;
  const auto engine = [](const int& frame, std::size_t) { return frame; };
  Pool pool({engine, engine, engine}, 3, received.Taker());
  std::atomic<bool> balanced{true};
  const auto push = [&] {
    for (int frame = 0; frame < 3000; ++frame) {
      pool.Push(frame);
      if (!Balanced(pool.counters())) balanced = false;
    }
  };
  std::thread first(push);
  std::thread second(push);
  first.join();
  second.join();
  while (pool.counters().waiting > 0) std::this_thread::yield();
  pool.Close();
  EXPECT_TRUE(balanced);
  EXPECT_EQ(pool.counters().in, 6000U);
  EXPECT_EQ(pool.counters().processed, received.items().size());
}

}  // namespace
}  // namespace livemap::perception
