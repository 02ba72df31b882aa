#include "zone/inbox/catch_up_planner.h"

#include <algorithm>

namespace livemap::zone {
namespace {

std::int64_t SecondsToNs(double seconds) { return static_cast<std::int64_t>(seconds * 1e9); }

}  // namespace

CatchUpPlanner::Vehicle& CatchUpPlanner::Heard(const std::string& vehicle_id, std::int64_t now_ns) {
  const auto found = vehicles_.find(vehicle_id);
  if (found == vehicles_.end() && vehicles_.size() >= config_.max_vehicles) {
    vehicles_.erase(std::min_element(
        vehicles_.begin(), vehicles_.end(),
        [](const auto& a, const auto& b) { return a.second.heard_ns < b.second.heard_ns; }));
  }
  Vehicle& vehicle = vehicles_[vehicle_id];
  if (vehicle.heard_ns != 0 && now_ns - vehicle.heard_ns > SecondsToNs(config_.gap_s)) {
    const bool in_progress = vehicle.in_progress;
    const auto asked_cells_ns = vehicle.asked_cells_ns;
    vehicle = Vehicle{};
    vehicle.asked_cells_ns = asked_cells_ns;
    vehicle.in_progress = in_progress;
  }
  if (vehicle.heard_ns == 0) vehicle.new_ns = now_ns;
  vehicle.heard_ns = now_ns;
  return vehicle;
}

std::optional<CatchUpOrder> CatchUpPlanner::Update(const std::string& vehicle_id,
                                                   const geo::GeoPoint& position,
                                                   std::uint64_t map_sequence,
                                                   std::uint64_t announced, std::int64_t now_ns) {
  Vehicle& vehicle = Heard(vehicle_id, now_ns);
  const bool asks_cells =
      vehicle.asked_cells_ns && now_ns - *vehicle.asked_cells_ns <= SecondsToNs(config_.cell_gap_s);
  if (asks_cells || now_ns - vehicle.new_ns < SecondsToNs(config_.cell_wait_s)) return std::nullopt;
  // What was never announced is no knowledge: it shows no progress.
  if (map_sequence >= vehicle.target && map_sequence <= announced) {
    vehicle.target = announced;
    vehicle.target_ns = now_ns;
    if (map_sequence > vehicle.known) vehicle.retry_s = config_.retry_s;
    vehicle.known = std::max(vehicle.known, map_sequence);
  }
  if (vehicle.in_progress || now_ns < vehicle.not_before_ns) return std::nullopt;
  const bool all = !vehicle.centre || map_sequence > announced ||
                   (map_sequence == 0 && announced > 0) ||
                   geo::GeodesicDistanceM(*vehicle.centre, position) > config_.radius_m / 2;
  const bool lags =
      map_sequence < vehicle.target && now_ns - vehicle.target_ns > SecondsToNs(config_.lag_s);
  if (!all && !lags) return std::nullopt;
  if (all) vehicle.centre = position;
  // Nothing was ever announced, and the vehicle knows nothing else.
  if (announced == 0 && map_sequence == 0) return std::nullopt;
  vehicle.in_progress = true;
  vehicle.target = std::max(vehicle.target, announced);
  return CatchUpOrder{vehicle_id, *vehicle.centre, all ? 0 : map_sequence, map_sequence};
}

bool CatchUpPlanner::TakeInvitation(const std::string& vehicle_id) {
  const auto found = vehicles_.find(vehicle_id);
  if (found == vehicles_.end() || found->second.is_invited) return false;
  found->second.is_invited = true;
  return !found->second.asked_cells_ns;
}

void CatchUpPlanner::NoteCellRequest(const std::string& vehicle_id, std::int64_t now_ns) {
  Heard(vehicle_id, now_ns).asked_cells_ns = now_ns;
}

void CatchUpPlanner::Told(const std::string& vehicle_id, std::int64_t now_ns) {
  const auto found = vehicles_.find(vehicle_id);
  if (found == vehicles_.end()) return;
  Vehicle& vehicle = found->second;
  vehicle.in_progress = false;
  vehicle.retry_s = std::max(vehicle.retry_s, config_.retry_s);
  vehicle.not_before_ns = now_ns + SecondsToNs(vehicle.retry_s);
  vehicle.retry_s = std::min(2 * vehicle.retry_s, config_.longest_retry_s);
}

}  // namespace livemap::zone
