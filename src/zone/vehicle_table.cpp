#include "zone/vehicle_table.h"

#include <algorithm>

namespace livemap {

VehicleTable::VehicleTable(double retention_s, std::size_t max_vehicles)
    : retention_ns_(static_cast<std::int64_t>(retention_s * 1e9)), max_vehicles_(max_vehicles) {}

void VehicleTable::Update(const VehicleState& vehicle) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto known = vehicles_.find(vehicle.vehicle_id);
  if (known != vehicles_.end()) {
    known->second = vehicle;
    return;
  }
  for (auto other = vehicles_.begin(); other != vehicles_.end();) {
    const bool forgotten = vehicle.heard_ns - other->second.heard_ns > retention_ns_;
    other = forgotten ? vehicles_.erase(other) : std::next(other);
  }
  if (vehicles_.size() >= max_vehicles_) {
    vehicles_.erase(std::min_element(
        vehicles_.begin(), vehicles_.end(),
        [](const auto& a, const auto& b) { return a.second.heard_ns < b.second.heard_ns; }));
  }
  vehicles_.emplace(vehicle.vehicle_id, vehicle);
}

std::vector<VehicleState> VehicleTable::List(std::int64_t now_ns) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<VehicleState> result;
  for (const auto& [id, vehicle] : vehicles_) {
    if (now_ns - vehicle.heard_ns <= retention_ns_) result.push_back(vehicle);
  }
  return result;
}

}  // namespace livemap
