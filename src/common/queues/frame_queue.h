#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

#include "common/mutex.h"

namespace livemap {

/// Hands items from the threads that receive them to one thread that works on them. When the worker
/// is behind, the oldest waiting item goes and is counted: fresh frames matter more than old ones.
/// Every item is accounted for: in = processed + dropped + waiting, at any moment. Thread-safe.
template <typename Item>
class FrameQueue {
 public:
  struct Counters {
    std::uint64_t in = 0;         ///< Pushed so far.
    std::uint64_t processed = 0;  ///< Taken and reported done.
    std::uint64_t dropped = 0;    ///< Displaced by newer ones, or taken and reported unusable.
    std::uint64_t waiting = 0;    ///< In the queue or in work.
  };

  /// `capacity` >= 1: how many items may wait, not counting the one in work.
  explicit FrameQueue(std::size_t capacity) : capacity_(capacity) {}

  /// Never blocks. After Close nothing is taken in.
  void Push(Item item) {
    {
      const MutexLock lock(mutex_);
      if (closed_) return;
      ++counters_.in;
      if (items_.size() == capacity_) {
        items_.pop_front();
        ++counters_.dropped;
      }
      items_.push_back(std::move(item));
    }
    available_.NotifyOne();
  }

  /// Waits for the next item; none when the queue is closed. Done or Unusable must follow each
  /// item.
  std::optional<Item> Pop() {
    const MutexLock lock(mutex_);
    while (!closed_ && items_.empty()) available_.Wait(mutex_);
    if (closed_) return std::nullopt;
    std::optional<Item> item(std::move(items_.front()));
    items_.pop_front();
    ++in_work_;
    return item;
  }

  /// The worker has finished an item.
  void Done() { Finish(&Counters::processed); }
  /// The worker could not use an item.
  void Unusable() { Finish(&Counters::dropped); }

  /// Wakes the worker to stop; what still waits counts as dropped.
  void Close() {
    {
      const MutexLock lock(mutex_);
      closed_ = true;
      counters_.dropped += items_.size();
      items_.clear();
    }
    available_.NotifyAll();
  }

  Counters counters() const {
    const MutexLock lock(mutex_);
    Counters counters = counters_;
    counters.waiting = items_.size() + in_work_;
    return counters;
  }

 private:
  void Finish(std::uint64_t Counters::*counter) {
    const MutexLock lock(mutex_);
    --in_work_;
    ++(counters_.*counter);
  }

  const std::size_t capacity_;
  mutable Mutex mutex_;
  ConditionVariable available_;
  std::deque<Item> items_ GUARDED_BY(mutex_);
  std::size_t in_work_ GUARDED_BY(mutex_) = 0;
  Counters counters_ GUARDED_BY(mutex_);
  bool closed_ GUARDED_BY(mutex_) = false;
};

}  // namespace livemap
