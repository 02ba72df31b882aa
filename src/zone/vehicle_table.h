#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "zone/zone_service.h"

namespace livemap {

/// Where the vehicles were last: bounded in time and number. Thread-safe.
class VehicleTable {
 public:
  VehicleTable(double retention_s, std::size_t max_vehicles);

  /// `vehicle.heard_ns` is now.
  void Update(const VehicleState& vehicle);
  /// Those heard of within the retention time, by id.
  std::vector<VehicleState> List(std::int64_t now_ns) const;

 private:
  const std::int64_t retention_ns_;
  const std::size_t max_vehicles_;
  mutable std::mutex mutex_;
  std::map<std::string, VehicleState> vehicles_;
};

}  // namespace livemap
