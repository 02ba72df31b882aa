#include "web/api/vehicle_trails.h"

#include <cmath>
#include <iterator>

#include "common/time.h"

namespace livemap::web {

void VehicleTrails::Add(const zone::VehicleState& vehicle) {
  if (!geo::IsValid(vehicle.position)) return;
  const MutexLock lock(mutex_);
  DropSilent(vehicle.heard_ns);
  auto trail = trails_.find(vehicle.vehicle_id);
  if (trail == trails_.end()) {
    if (trails_.size() >= config_.max_vehicles) return;
    trail = trails_.emplace(vehicle.vehicle_id, Trail()).first;
  }
  trail->second.heard_ns = vehicle.heard_ns;
  std::deque<geo::GeoPoint>& points = trail->second.points;
  if (!points.empty() &&
      geo::GeodesicDistanceM(points.back(), vehicle.position) < config_.spacing_m) {
    return;
  }
  points.push_back(vehicle.position);
  if (points.size() > config_.max_points) points.pop_front();
}

/// Once a minute: they are looked at all.
void VehicleTrails::DropSilent(std::int64_t now_ns) {
  constexpr double kRestS = 60;
  if (std::abs(Seconds(now_ns - swept_ns_)) < kRestS) return;
  swept_ns_ = now_ns;
  for (auto trail = trails_.begin(); trail != trails_.end();) {
    const bool is_silent = Seconds(now_ns - trail->second.heard_ns) > config_.max_silence_s;
    trail = is_silent ? trails_.erase(trail) : std::next(trail);
  }
}

void VehicleTrails::Forget(const std::string& vehicle_id) {
  const MutexLock lock(mutex_);
  trails_.erase(vehicle_id);
}

TrailPositions VehicleTrails::Get(const std::string& vehicle_id) const {
  const MutexLock lock(mutex_);
  const auto trail = trails_.find(vehicle_id);
  TrailPositions positions;
  if (trail == trails_.end()) return positions;
  positions.reserve(trail->second.points.size());
  for (const geo::GeoPoint& point : trail->second.points) {
    positions.emplace_back(point.longitude_deg, point.latitude_deg);
  }
  return positions;
}

}  // namespace livemap::web
