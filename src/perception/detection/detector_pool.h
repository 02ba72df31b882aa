#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/mutex.h"

namespace livemap::perception {

/// Gives items (frames) to N engines, each on its own thread, and hands their results on in the
/// order in which the items came, one at a time, from one further thread. An idle engine takes the
/// oldest waiting item, so as long as N / latency >= the rate of the items nothing is lost, also
/// when latencies are uneven. Beyond that the oldest waiting item goes and is counted: fresh frames
/// matter more than old ones. Every item is accounted for: in = processed + dropped + waiting, at
/// any moment. Thread-safe.
///
/// An engine that hangs holds back the results of the others: these work ahead of it by at most
/// `queue_size` items, so memory stays bounded.
template <typename Item, typename Result>
class DetectorPool {
 public:
  /// One engine's work on one item, behind which `waiting` others wait for an engine; called on
  /// that engine's thread only. May throw.
  using Engine = std::function<Result(const Item&, std::size_t waiting)>;

  /// What became of an item.
  struct Outcome {
    Item item;
    std::optional<Result> result;  ///< None: the engine threw.
    std::string error;             ///< What it said then.
  };
  /// Called for every item that an engine took, in the order of the items; the next call comes when
  /// this one has returned. An exception from it counts the item as dropped and goes no further.
  using OnOutcome = std::function<void(const Outcome&)>;

  struct Counters {
    std::uint64_t in = 0;         ///< Pushed so far.
    std::uint64_t processed = 0;  ///< Has a result that was handed on.
    std::uint64_t dropped = 0;    ///< Displaced by newer ones, or the engine threw.
    std::uint64_t waiting = 0;  ///< In the queue, in work, or waiting for an earlier one's result.
  };

  /// `queue_size` >= 1: how many items may wait, not counting those in work. Starts the threads.
  DetectorPool(std::vector<Engine> engines, std::size_t queue_size, OnOutcome on_outcome)
      : engines_(std::move(engines)),
        queue_size_(queue_size),
        max_in_flight_(engines_.size() + queue_size),
        on_outcome_(std::move(on_outcome)) {
    try {
      threads_.emplace_back([this] { Deliver(); });
      for (Engine& engine : engines_) threads_.emplace_back([this, &engine] { Work(engine); });
    } catch (...) {
      Close();
      throw;
    }
  }
  ~DetectorPool() { Close(); }
  DetectorPool(const DetectorPool&) = delete;
  DetectorPool& operator=(const DetectorPool&) = delete;

  /// Never blocks. After Close nothing is taken in.
  void Push(Item item) {
    {
      const MutexLock lock(mutex_);
      if (closed_) return;
      ++counters_.in;
      if (queue_.size() == queue_size_) {
        queue_.pop_front();
        ++counters_.dropped;
      }
      queue_.push_back(std::move(item));
    }
    work_.NotifyOne();
  }

  /// Waits for what the engines and the callback do right now and ends the threads; what was not
  /// handed on counts as dropped. Not to be called from the callback.
  void Close() {
    {
      const MutexLock lock(mutex_);
      closed_ = true;
    }
    work_.NotifyAll();
    finished_.NotifyAll();
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
    const MutexLock lock(mutex_);
    counters_.dropped += queue_.size() + in_flight_;
    in_flight_ = 0;
    queue_.clear();
    results_.clear();
  }

  Counters counters() const {
    const MutexLock lock(mutex_);
    Counters counters = counters_;
    counters.waiting = queue_.size() + in_flight_;
    return counters;
  }

 private:
  void Work(const Engine& engine) {
    MutexLock lock(mutex_);
    while (true) {
      while (!closed_ && (queue_.empty() || in_flight_ >= max_in_flight_)) work_.Wait(mutex_);
      if (closed_) return;
      const std::uint64_t number = taken_++;
      Outcome outcome{std::move(queue_.front()), std::nullopt, ""};
      queue_.pop_front();
      const std::size_t waiting = queue_.size();
      ++in_flight_;
      lock.Unlock();
      try {
        outcome.result = engine(outcome.item, waiting);
      } catch (const std::exception& error) {
        outcome.error = error.what();
      } catch (...) {
        outcome.error = "an exception of another kind";
      }
      lock.Lock();
      results_.emplace(number, std::move(outcome));
      finished_.NotifyOne();
    }
  }

  void Deliver() {
    MutexLock lock(mutex_);
    while (true) {
      while (!closed_ && (results_.empty() || results_.begin()->first != delivered_)) {
        finished_.Wait(mutex_);
      }
      if (closed_) return;
      std::optional<Outcome> outcome(std::move(results_.begin()->second));
      results_.erase(results_.begin());
      lock.Unlock();
      const bool used = Tell(*outcome) && outcome->result.has_value();
      outcome.reset();  // an image's memory is freed without the lock
      lock.Lock();
      ++delivered_;
      --in_flight_;
      ++(used ? counters_.processed : counters_.dropped);
      work_.NotifyOne();
    }
  }

  bool Tell(const Outcome& outcome) {
    try {
      on_outcome_(outcome);
      return true;
    } catch (...) {
      return false;
    }
  }

  std::vector<Engine> engines_;
  const std::size_t queue_size_;
  const std::size_t max_in_flight_;  ///< In work, or finished and not handed on.
  const OnOutcome on_outcome_;

  mutable Mutex mutex_;
  ConditionVariable work_;      ///< There is an item, or room for its result.
  ConditionVariable finished_;  ///< There is a result.
  std::deque<Item> queue_ GUARDED_BY(mutex_);
  std::map<std::uint64_t, Outcome> results_
      GUARDED_BY(mutex_);                       ///< Finished, by number of the item.
  std::uint64_t taken_ GUARDED_BY(mutex_) = 0;  ///< Items that engines took; the next one's number.
  std::uint64_t delivered_ GUARDED_BY(mutex_) = 0;  ///< Number of the item that is handed on next.
  std::size_t in_flight_ GUARDED_BY(mutex_) = 0;
  Counters counters_ GUARDED_BY(mutex_);
  bool closed_ GUARDED_BY(mutex_) = false;
  std::vector<std::thread> threads_;
};

}  // namespace livemap::perception
