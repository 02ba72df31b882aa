#include "zone/vehicle_table.h"

#include <algorithm>

namespace livemap {

VehicleTable::VehicleTable(double retention_s, std::size_t max_vehicles)
    : retention_ns_(static_cast<std::int64_t>(retention_s * 1e9)), max_vehicles_(max_vehicles) {}

void VehicleTable::Update(const VehicleState& vehicle, std::int64_t now_ns) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto known = entries_.find(vehicle.vehicle_id);
  if (known != entries_.end()) {
    known->second = {vehicle, now_ns};
    return;
  }
  for (auto entry = entries_.begin(); entry != entries_.end();) {
    const bool forgotten = now_ns - entry->second.heard_ns > retention_ns_;
    entry = forgotten ? entries_.erase(entry) : std::next(entry);
  }
  if (entries_.size() >= max_vehicles_) {
    entries_.erase(std::min_element(
        entries_.begin(), entries_.end(),
        [](const auto& a, const auto& b) { return a.second.heard_ns < b.second.heard_ns; }));
  }
  entries_[vehicle.vehicle_id] = {vehicle, now_ns};
}

std::vector<VehicleState> VehicleTable::List(std::int64_t now_ns) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<VehicleState> vehicles;
  for (const auto& [id, entry] : entries_) {
    if (now_ns - entry.heard_ns <= retention_ns_) vehicles.push_back(entry.state);
  }
  return vehicles;
}

}  // namespace livemap
