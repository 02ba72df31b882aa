#pragma once

#include <map>
#include <mutex>
#include <utility>

#include "zone/service/zone_service.h"

namespace livemap::zone {

/// Hands events to subscribers, one call at a time, in the order of the calls to Publish.
class EventStream {
 public:
  int Subscribe(ZoneService::Subscriber subscriber) {
    const std::lock_guard<std::mutex> lock(mutex_);
    subscribers_.emplace(++last_id_, std::move(subscriber));
    return last_id_;
  }
  /// Waits for a call in progress.
  void Unsubscribe(int id) {
    const std::lock_guard<std::mutex> lock(mutex_);
    subscribers_.erase(id);
  }
  void Publish(const ZoneEvent& event) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& subscriber : subscribers_) subscriber.second(event);
  }

 private:
  std::mutex mutex_;
  std::map<int, ZoneService::Subscriber> subscribers_;
  int last_id_ = 0;
};

}  // namespace livemap::zone
