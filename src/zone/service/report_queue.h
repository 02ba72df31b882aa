#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <utility>
#include <vector>

#include "protocol/report.h"

namespace livemap::zone {

/// Reports that wait for the next group commit, bounded in number and in bytes of pictures.
/// Thread-safe. What does not fit is not taken: its vehicle sends it again.
class ReportQueue {
 public:
  ReportQueue(std::size_t max_reports, std::size_t max_bytes)
      : max_reports_(max_reports), max_bytes_(max_bytes) {}

  /// False when the queue is full or closed.
  bool Push(protocol::Report report) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const std::size_t bytes = report.image.size();
      if (closed_ || reports_.size() >= max_reports_ || bytes_ + bytes > max_bytes_) return false;
      bytes_ += bytes;
      reports_.push_back(std::move(report));
    }
    arrived_.notify_one();
    return true;
  }

  /// Waits up to `patience` for a report, then takes what is there, oldest first, at most `limit`.
  std::vector<protocol::Report> Take(std::size_t limit, std::chrono::milliseconds patience) {
    std::unique_lock<std::mutex> lock(mutex_);
    arrived_.wait_for(lock, patience, [this] { return closed_ || !reports_.empty(); });
    std::vector<protocol::Report> taken;
    while (!reports_.empty() && taken.size() < limit) {
      bytes_ -= reports_.front().image.size();
      taken.push_back(std::move(reports_.front()));
      reports_.pop_front();
    }
    return taken;
  }

  /// Wakes the taker; nothing is accepted any more, what is there can still be taken.
  void Close() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      closed_ = true;
    }
    arrived_.notify_all();
  }
  bool closed() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return closed_;
  }
  std::size_t size() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return reports_.size();
  }

 private:
  const std::size_t max_reports_;
  const std::size_t max_bytes_;
  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<protocol::Report> reports_;
  std::size_t bytes_ = 0;
  bool closed_ = false;
};

}  // namespace livemap::zone
