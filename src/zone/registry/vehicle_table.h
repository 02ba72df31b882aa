#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "zone/model/vehicle_state.h"
#include "zone/registry/vehicle_track.h"

namespace livemap::zone {

/// Where the vehicles were last: bounded in time and number. Thread-safe.
class VehicleTable {
 public:
  VehicleTable(double retention_s, std::size_t max_vehicles);

  /// `vehicle.heard_ns` is now.
  void Update(const VehicleState& vehicle);
  /// Those heard of within the retention time, by id.
  std::vector<VehicleState> List(std::int64_t now_ns) const;
  /// Where the vehicle was during the last two minutes, by when the zone heard it, oldest first, at
  /// most the newest 240 places.
  std::vector<TrackPoint> Track(const std::string& vehicle_id) const;

 private:
  void MakeRoom(std::int64_t now_ns) REQUIRES(mutex_);

  const std::int64_t retention_ns_;
  const std::size_t max_vehicles_;
  mutable Mutex mutex_;
  struct Vehicle {
    VehicleState state;
    std::deque<TrackPoint> track;
  };
  std::map<std::string, Vehicle> vehicles_ GUARDED_BY(mutex_);
};

}  // namespace livemap::zone
