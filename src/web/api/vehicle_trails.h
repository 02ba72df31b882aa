#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <string>

#include "common/mutex.h"
#include "web/json/json.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// Where each vehicle lately drove, so that a page opened in the middle of a drive shows the whole
/// trail. Bounded in points and vehicles; lives in memory only. Thread-safe.
class VehicleTrails {
 public:
  struct Config {
    double spacing_m = 5;             ///< A position nearer to its predecessor adds no point.
    std::size_t max_points = 2000;    ///< Per vehicle; the oldest goes first.
    std::size_t max_vehicles = 1000;  ///< Vehicles beyond this get no trail.
  };

  VehicleTrails() = default;
  explicit VehicleTrails(Config config) : config_(config) {}

  void Add(const zone::VehicleState& vehicle);
  /// Oldest first; empty for an unknown vehicle.
  TrailPositions Get(const std::string& vehicle_id) const;

 private:
  Config config_;
  mutable Mutex mutex_;
  std::map<std::string, std::deque<geo::GeoPoint>> trails_ GUARDED_BY(mutex_);
};

}  // namespace livemap::web
