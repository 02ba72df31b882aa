#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "protocol/cell_news.h"
#include "protocol/map_change_report.h"
#include "protocol/poll.h"
#include "protocol/report.h"
#include "zone/inbox/catch_up_planner.h"

namespace livemap::zone {

/// Everything that waits for the zone's worker, each kind in the order of its arrival. Whatever
/// comes in wakes the worker at once. Every kind is bounded: vehicles send a report or a map change
/// that did not fit again, and the zone asks anew where an answer was dropped.
///
/// Thread-safe.
///
/// Typical usage, by the worker:
///   while (true) {
///     const bool closing = inbox.closed();
///     const ZoneInbox::Batch batch = inbox.Take(patience);
///     Handle(batch);
///     if (closing && batch.empty()) return;
///   }
class ZoneInbox {
 public:
  struct Config {
    std::size_t max_reports = 20000;
    std::size_t max_bytes = 256'000'000;  ///< Of the reports' pictures together.
    std::size_t max_map_changes = 10000;
    std::size_t max_answers = 10000;
    std::size_t max_cell_requests = 20000;
    std::size_t batch = 500;  ///< Reports, and map changes, that are taken at once.
  };
  struct Batch {
    std::vector<protocol::Report> reports;
    std::vector<protocol::MapChangeReport> map_changes;
    std::deque<protocol::PollAnswer> answers;
    std::deque<CatchUpOrder> orders;
    std::deque<protocol::CellRequest> cell_requests;

    bool empty() const {
      return reports.empty() && map_changes.empty() && answers.empty() && orders.empty() &&
             cell_requests.empty();
    }
  };

  explicit ZoneInbox(const Config& config) : config_(config) {}

  /// False when there is no room for the report, or the inbox is closed.
  bool Push(protocol::Report report);
  /// False when there is no room for the map change, or the inbox is closed.
  bool Push(protocol::MapChangeReport report);
  /// False when the oldest answer made room for this one: it has waited longest, and its poll
  /// expires first. A closed inbox takes none.
  bool Push(protocol::PollAnswer answer);
  /// CatchUpPlanner gives one order for each of a bounded number of vehicles; a closed inbox takes
  /// none.
  void Push(CatchUpOrder order);

  /// False when there is no room for the request, or the inbox is closed: the vehicle asks again.
  bool Push(protocol::CellRequest request);

  /// Waits up to `patience` for anything, then takes what is there, oldest first: all answers,
  /// orders and requests for cells, and reports and map changes up to Config::batch each.
  Batch Take(std::chrono::milliseconds patience);

  /// Wakes the worker; nothing is accepted any more, what is there can still be taken.
  void Close();
  bool closed() const;
  std::size_t reports() const;
  std::size_t map_changes() const;

 private:
  bool HasNews() const REQUIRES(mutex_) {
    return closed_ || !reports_.empty() || !map_changes_.empty() || !answers_.empty() ||
           !orders_.empty() || !cell_requests_.empty();
  }

  const Config config_;
  mutable Mutex mutex_;
  ConditionVariable arrived_;
  std::deque<protocol::Report> reports_ GUARDED_BY(mutex_);
  std::deque<protocol::MapChangeReport> map_changes_ GUARDED_BY(mutex_);
  std::deque<protocol::PollAnswer> answers_ GUARDED_BY(mutex_);
  std::deque<CatchUpOrder> orders_ GUARDED_BY(mutex_);
  std::deque<protocol::CellRequest> cell_requests_ GUARDED_BY(mutex_);
  std::size_t bytes_ GUARDED_BY(mutex_) = 0;  ///< Of the reports' pictures.
  bool closed_ GUARDED_BY(mutex_) = false;
};

inline bool ZoneInbox::Push(protocol::Report report) {
  {
    const MutexLock lock(mutex_);
    const std::size_t bytes = report.image.size();
    const bool full = reports_.size() >= config_.max_reports || bytes_ + bytes > config_.max_bytes;
    if (closed_ || full) return false;
    bytes_ += bytes;
    reports_.push_back(std::move(report));
  }
  arrived_.NotifyOne();
  return true;
}

inline bool ZoneInbox::Push(protocol::MapChangeReport report) {
  {
    const MutexLock lock(mutex_);
    if (closed_ || map_changes_.size() >= config_.max_map_changes) return false;
    map_changes_.push_back(std::move(report));
  }
  arrived_.NotifyOne();
  return true;
}

inline bool ZoneInbox::Push(protocol::PollAnswer answer) {
  bool all_kept = true;
  {
    const MutexLock lock(mutex_);
    if (closed_) return false;
    answers_.push_back(std::move(answer));
    if (answers_.size() > config_.max_answers) {
      answers_.pop_front();
      all_kept = false;
    }
  }
  arrived_.NotifyOne();
  return all_kept;
}

inline void ZoneInbox::Push(CatchUpOrder order) {
  {
    const MutexLock lock(mutex_);
    if (closed_) return;
    orders_.push_back(std::move(order));
  }
  arrived_.NotifyOne();
}

inline bool ZoneInbox::Push(protocol::CellRequest request) {
  {
    const MutexLock lock(mutex_);
    if (closed_ || cell_requests_.size() >= config_.max_cell_requests) return false;
    cell_requests_.push_back(std::move(request));
  }
  arrived_.NotifyOne();
  return true;
}

inline ZoneInbox::Batch ZoneInbox::Take(std::chrono::milliseconds patience) {
  const MutexLock lock(mutex_);
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!HasNews() && arrived_.WaitUntil(mutex_, deadline)) {
  }
  Batch batch;
  batch.answers.swap(answers_);
  batch.orders.swap(orders_);
  batch.cell_requests.swap(cell_requests_);
  while (!map_changes_.empty() && batch.map_changes.size() < config_.batch) {
    batch.map_changes.push_back(std::move(map_changes_.front()));
    map_changes_.pop_front();
  }
  while (!reports_.empty() && batch.reports.size() < config_.batch) {
    bytes_ -= reports_.front().image.size();
    batch.reports.push_back(std::move(reports_.front()));
    reports_.pop_front();
  }
  return batch;
}

inline void ZoneInbox::Close() {
  {
    const MutexLock lock(mutex_);
    closed_ = true;
  }
  arrived_.NotifyAll();
}

inline bool ZoneInbox::closed() const {
  const MutexLock lock(mutex_);
  return closed_;
}

inline std::size_t ZoneInbox::reports() const {
  const MutexLock lock(mutex_);
  return reports_.size();
}

inline std::size_t ZoneInbox::map_changes() const {
  const MutexLock lock(mutex_);
  return map_changes_.size();
}

}  // namespace livemap::zone
