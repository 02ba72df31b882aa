#include "zone/registry/vehicle_table.h"

#include <algorithm>

#include "common/time.h"

namespace livemap::zone {
namespace {

constexpr std::size_t kMaxPlaces = 240;
constexpr std::int64_t kTrackNs = 120'000'000'000;

}  // namespace

VehicleTable::VehicleTable(double retention_s, std::size_t max_vehicles)
    : retention_ns_(static_cast<std::int64_t>(retention_s * 1e9)), max_vehicles_(max_vehicles) {}

bool VehicleTable::Vehicle::Tell(std::int64_t now_ns) {
  // The zone's clock may be set back.
  const bool is_time = told_ns == INT64_MIN || now_ns < told_ns || now_ns - told_ns >= kTellNs;
  is_untold = !is_time;
  if (is_time) told_ns = now_ns;
  return is_time;
}

bool VehicleTable::Update(const VehicleState& vehicle) {
  const MutexLock lock(mutex_);
  auto known = vehicles_.find(vehicle.vehicle_id);
  if (known == vehicles_.end()) {
    MakeRoom(vehicle.heard_ns);
    known = vehicles_.emplace(vehicle.vehicle_id, Vehicle{}).first;
  }
  known->second.state = vehicle;
  std::deque<TrackPoint>& track = known->second.track;
  // The zone's clock may be set back; a track is in order.
  if (!track.empty() && vehicle.heard_ns < track.back().stamp_ns) track.clear();
  track.push_back({vehicle.heard_ns, vehicle.position, vehicle.course_rad, vehicle.speed_mps});
  while (track.size() > kMaxPlaces || vehicle.heard_ns - track.front().stamp_ns > kTrackNs) {
    track.pop_front();
  }
  return known->second.Tell(vehicle.heard_ns);
}

std::vector<VehicleState> VehicleTable::TakeUntold(std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  std::vector<VehicleState> untold;
  for (auto& [id, vehicle] : vehicles_) {
    if (vehicle.is_untold && vehicle.Tell(now_ns)) untold.push_back(vehicle.state);
  }
  return untold;
}

void VehicleTable::MakeRoom(std::int64_t now_ns) {
  for (auto other = vehicles_.begin(); other != vehicles_.end();) {
    const bool forgotten = now_ns - other->second.state.heard_ns > retention_ns_;
    other = forgotten ? vehicles_.erase(other) : std::next(other);
  }
  if (vehicles_.size() < max_vehicles_) return;
  vehicles_.erase(
      std::min_element(vehicles_.begin(), vehicles_.end(), [](const auto& a, const auto& b) {
        return a.second.state.heard_ns < b.second.state.heard_ns;
      }));
}

std::vector<VehicleState> VehicleTable::List(std::int64_t now_ns) const {
  const MutexLock lock(mutex_);
  std::vector<VehicleState> result;
  for (const auto& [id, vehicle] : vehicles_) {
    if (now_ns - vehicle.state.heard_ns <= retention_ns_) result.push_back(vehicle.state);
  }
  return result;
}

std::vector<VehicleState> VehicleTable::ListAfter(const std::string& id, std::size_t limit,
                                                  std::int64_t now_ns) const {
  const MutexLock lock(mutex_);
  std::vector<VehicleState> result;
  for (auto known = vehicles_.upper_bound(id); known != vehicles_.end(); ++known) {
    if (result.size() == limit) break;
    const VehicleState& state = known->second.state;
    if (now_ns - state.heard_ns <= retention_ns_) result.push_back(state);
  }
  return result;
}

std::vector<double> VehicleTable::OutboxAges(std::int64_t now_ns, double within_s) const {
  std::vector<double> ages_s;
  {
    const MutexLock lock(mutex_);
    for (const auto& [id, vehicle] : vehicles_) {
      if (!vehicle.state.outbox_age_s || Seconds(now_ns - vehicle.state.heard_ns) > within_s) {
        continue;
      }
      ages_s.push_back(*vehicle.state.outbox_age_s);
    }
  }
  std::sort(ages_s.begin(), ages_s.end());
  return ages_s;
}

std::vector<TrackPoint> VehicleTable::Track(const std::string& vehicle_id) const {
  const MutexLock lock(mutex_);
  const auto known = vehicles_.find(vehicle_id);
  if (known == vehicles_.end()) return {};
  return {known->second.track.begin(), known->second.track.end()};
}

void VehicleTable::Forget(const std::string& vehicle_id) {
  const MutexLock lock(mutex_);
  vehicles_.erase(vehicle_id);
}

}  // namespace livemap::zone
