#include "web/api/vehicle_trails.h"

namespace livemap::web {

void VehicleTrails::Add(const zone::VehicleState& vehicle) {
  if (!geo::IsValid(vehicle.position)) return;
  const MutexLock lock(mutex_);
  auto trail = trails_.find(vehicle.vehicle_id);
  if (trail == trails_.end()) {
    if (trails_.size() >= config_.max_vehicles) return;
    trail = trails_.emplace(vehicle.vehicle_id, std::deque<geo::GeoPoint>()).first;
  }
  std::deque<geo::GeoPoint>& points = trail->second;
  if (!points.empty() &&
      geo::GeodesicDistanceM(points.back(), vehicle.position) < config_.spacing_m) {
    return;
  }
  points.push_back(vehicle.position);
  if (points.size() > config_.max_points) points.pop_front();
}

TrailPositions VehicleTrails::Get(const std::string& vehicle_id) const {
  const MutexLock lock(mutex_);
  const auto trail = trails_.find(vehicle_id);
  TrailPositions positions;
  if (trail == trails_.end()) return positions;
  positions.reserve(trail->second.size());
  for (const geo::GeoPoint& point : trail->second) {
    positions.emplace_back(point.longitude_deg, point.latitude_deg);
  }
  return positions;
}

}  // namespace livemap::web
