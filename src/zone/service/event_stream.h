#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "common/mutex.h"
#include "zone/model/hazard.h"
#include "zone/model/map_change.h"
#include "zone/model/vehicle_state.h"

namespace livemap::zone {

/// One message of the zone's stream: exactly one of the four is set.
struct ZoneEvent {
  std::optional<HazardEvent> hazard;
  std::optional<MapChangeEvent> map_change;
  std::optional<VehicleState> vehicle;
  std::optional<std::string> forgotten;  ///< A vehicle of which nothing may be known any more.
};

/// Hands events to subscribers, one call at a time, in the order of the calls to Publish.
class EventStream {
 public:
  using Subscriber = std::function<void(const ZoneEvent&)>;

  int Subscribe(Subscriber subscriber) {
    const MutexLock lock(mutex_);
    subscribers_.emplace(++last_id_, std::move(subscriber));
    return last_id_;
  }
  /// Waits for a call in progress.
  void Unsubscribe(int id) {
    const MutexLock lock(mutex_);
    subscribers_.erase(id);
  }
  void Publish(const ZoneEvent& event) {
    const MutexLock lock(mutex_);
    for (const auto& subscriber : subscribers_) subscriber.second(event);
  }

 private:
  Mutex mutex_;
  std::map<int, Subscriber> subscribers_ GUARDED_BY(mutex_);
  int last_id_ GUARDED_BY(mutex_) = 0;
};

}  // namespace livemap::zone
