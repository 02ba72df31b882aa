#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>

#include "geo/wgs84.h"

namespace livemap::zone {

/// Finds a map's origin among the first places that the zone hears of: the first of them that
/// enough others agree with. One place alone, however it came about, is no origin.
///
/// Bounded; not thread-safe.
class MapOrigin {
 public:
  struct Config {
    double reach_m = 20000;           ///< Places within so far of each other agree.
    std::uint32_t votes = 3;          ///< That agree before one of them is the origin.
    double vehicle_pause_s = 10;      ///< A vehicle votes once in so long.
    std::size_t max_places = 64;      ///< Remembered; the oldest goes first.
    std::size_t max_vehicles = 1000;  ///< Whose last vote is remembered; beyond it none counts.
  };

  MapOrigin() = default;
  explicit MapOrigin(const Config& config) : config_(config) {}

  /// A hazard stands at `place`, which must be valid; so many vehicles say so. The origin, once
  /// there is one.
  std::optional<geo::GeoPoint> AddHazard(const geo::GeoPoint& place, std::uint32_t vehicles) {
    return Add(place, std::max<std::uint32_t>(1, vehicles));
  }
  /// A vehicle is at `place`, which must be valid. `now_ns` is any clock.
  std::optional<geo::GeoPoint> AddVehicle(const std::string& vehicle_id, const geo::GeoPoint& place,
                                          std::int64_t now_ns) {
    const auto last = voted_ns_.find(vehicle_id);
    if (last == voted_ns_.end() && voted_ns_.size() >= config_.max_vehicles) return std::nullopt;
    const auto pause_ns = static_cast<std::int64_t>(config_.vehicle_pause_s * 1e9);
    if (last != voted_ns_.end() && now_ns >= last->second && now_ns - last->second < pause_ns) {
      return std::nullopt;
    }
    voted_ns_[vehicle_id] = now_ns;
    return Add(place, 1);
  }

 private:
  struct Vote {
    geo::GeoPoint place;
    std::uint32_t weight = 1;
  };

  std::optional<geo::GeoPoint> Add(const geo::GeoPoint& place, std::uint32_t weight) {
    votes_.push_back({place, weight});
    if (votes_.size() > config_.max_places) votes_.pop_front();
    std::uint64_t agreeing = 0;
    std::optional<geo::GeoPoint> first;
    for (const Vote& vote : votes_) {
      if (geo::GeodesicDistanceM(vote.place, place) > config_.reach_m) continue;
      if (!first) first = vote.place;
      agreeing += vote.weight;
    }
    return agreeing >= config_.votes ? first : std::nullopt;
  }

  Config config_;
  std::deque<Vote> votes_;
  std::map<std::string, std::int64_t> voted_ns_;
};

}  // namespace livemap::zone
