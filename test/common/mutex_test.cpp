#include "common/mutex.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace livemap {
namespace {

/// A thread of which can be said that it waits for a lock.
class Locker {
 public:
  explicit Locker(std::function<void()> body)
      : thread_([this, body = std::move(body)] {
          id_ = gettid();
          body();
          is_done_ = true;
        }) {}
  ~Locker() { thread_.join(); }
  Locker(const Locker&) = delete;
  Locker& operator=(const Locker&) = delete;

  /// Returns once the thread sleeps, which its body does for the lock alone, or is done.
  void WaitUntilAsleepOrDone() const {
    while (!is_done_ && !IsAsleep()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }

 private:
  bool IsAsleep() const {
    if (id_ == 0) return false;
    std::ifstream file("/proc/self/task/" + std::to_string(id_) + "/stat");
    std::string line;
    std::getline(file, line);
    const std::size_t name_end = line.rfind(')');
    return name_end != std::string::npos && line.compare(name_end, 3, ") S") == 0;
  }

  std::atomic<pid_t> id_{0};
  std::atomic<bool> is_done_{false};
  std::thread thread_;  // Last: it uses the others.
};

TEST(SharedMutex, AReaderThatComesAfterAWaitingWriterWaitsUntilTheWriterWasIn) {
  SharedMutex mutex;
  Mutex order_mutex;
  std::vector<std::string> order;
  const auto note = [&](const char* who) {
    const MutexLock lock(order_mutex);
    order.emplace_back(who);
  };
  {
    std::optional<ReaderLock> first(std::in_place, mutex);
    const Locker writer([&] {
      const WriterLock lock(mutex);
      note("writer");
    });
    writer.WaitUntilAsleepOrDone();
    const Locker second([&] {
      const ReaderLock lock(mutex);
      note("reader");
    });
    second.WaitUntilAsleepOrDone();
    EXPECT_TRUE([&] {
      const MutexLock lock(order_mutex);
      return order.empty();
    }());
    first.reset();
  }
  EXPECT_EQ(order, (std::vector<std::string>{"writer", "reader"}));
}

TEST(SharedMutex, ReadersThatNoWriterWaitsForHoldItTogether) {
  SharedMutex mutex;
  bool is_in = false;
  const ReaderLock first(mutex);
  {
    const Locker second([&] {
      const ReaderLock lock(mutex);
      is_in = true;
    });
  }
  EXPECT_TRUE(is_in);
}

}  // namespace
}  // namespace livemap
