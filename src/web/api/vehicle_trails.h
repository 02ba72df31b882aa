#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>

#include "common/mutex.h"
#include "web/json/json.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// Where each vehicle lately drove, so that a page opened in the middle of a drive shows the whole
/// trail. Bounded in points, vehicles and time; lives in memory only. Thread-safe.
class VehicleTrails {
 public:
  struct Config {
    double spacing_m = 5;             ///< A position nearer to its predecessor adds no point.
    std::size_t max_points = 2000;    ///< Per vehicle; the oldest goes first.
    std::size_t max_vehicles = 1000;  ///< Vehicles beyond this get no trail.
    double max_silence_s = 3600;      ///< The trail of a vehicle that is silent for longer goes.
  };

  VehicleTrails() = default;
  explicit VehicleTrails(Config config) : config_(config) {}

  void Add(const zone::VehicleState& vehicle);
  void Forget(const std::string& vehicle_id);
  /// Oldest first; empty for an unknown vehicle.
  TrailPositions Get(const std::string& vehicle_id) const;

 private:
  struct Trail {
    std::deque<geo::GeoPoint> points;
    std::int64_t heard_ns = 0;  ///< Zone clock.
  };

  void DropSilent(std::int64_t now_ns) REQUIRES(mutex_);

  Config config_;
  mutable Mutex mutex_;
  std::map<std::string, Trail> trails_ GUARDED_BY(mutex_);
  std::int64_t swept_ns_ GUARDED_BY(mutex_) = 0;  ///< When silent ones last went, zone clock.
};

}  // namespace livemap::web
