#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "common/mutex.h"
#include "protocol/hazard_catalogue.h"
#include "web/api/vehicle_trails.h"
#include "zone/service/map_reader.h"

namespace livemap::web {

/// One message of the live stream, written once for all clients.
struct LiveMessage {
  std::shared_ptr<const std::string> text;
  std::uint64_t sequence = 0;  ///< Of an event; 0 for a vehicle position.
  bool is_told = false;        ///< Drivers hear of it, too.
};

/// A client of the live stream.
class LiveListener {
 public:
  virtual ~LiveListener() = default;
  /// Called from the zone's threads, in the order of the sequence; must not block.
  virtual void Deliver(const LiveMessage& message) = 0;
};

/// Hands the zone's events to every listener and to the vehicles' trails. Thread-safe.
class EventHub {
 public:
  /// Subscribes to the zone; keeps references.
  EventHub(zone::MapReader& zone, const protocol::HazardCatalogue& catalogue,
           VehicleTrails& trails);
  ~EventHub();
  EventHub(const EventHub&) = delete;
  EventHub& operator=(const EventHub&) = delete;

  /// Every event that is published after this call reaches the listener until it leaves; the hub
  /// keeps it alive until then.
  void Join(const std::shared_ptr<LiveListener>& listener);
  void Leave(const LiveListener* listener);
  /// Lets go of every listener, for good: when it returns, none is being called.
  void Stop();

 private:
  void Publish(const zone::ZoneEvent& event);

  zone::MapReader& zone_;
  const protocol::HazardCatalogue& catalogue_;
  VehicleTrails& trails_;
  Mutex mutex_;
  std::map<const LiveListener*, std::shared_ptr<LiveListener>> listeners_ GUARDED_BY(mutex_);
  bool stopped_ GUARDED_BY(mutex_) = false;
  int subscription_ = 0;
};

}  // namespace livemap::web
