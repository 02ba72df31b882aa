#pragma once

#include <cstddef>
#include <cstdint>
#include <set>

namespace livemap::zone {

/// Where a hazard stands in its life, as stored: the numbers never change. See
/// docs/explanation/hazard-lifecycle.md.
enum class HazardState : std::uint8_t {
  kCandidate = 0,  ///< On the officials' map only: drivers are not told yet.
  kActive = 1,     ///< Drivers are told.
  kVerifying = 2,  ///< Drivers are told, and the zone asks vehicles whether it is still there.
  kGone = 3,       ///< Off the map for good; seen again it is a new hazard.
  kRejected = 4,   ///< Taken off the map by an official; sightings go on counting as evidence.
};

constexpr std::size_t kHazardStates = 5;
using HazardStates = std::set<HazardState>;

/// Officials see it on the map.
constexpr bool IsOnMap(HazardState state) {
  return state == HazardState::kCandidate || state == HazardState::kActive ||
         state == HazardState::kVerifying;
}
/// All of these.
inline const HazardStates& StatesOnMap() {
  static const HazardStates states{HazardState::kCandidate, HazardState::kActive,
                                   HazardState::kVerifying};
  return states;
}
/// Drivers are told of it.
constexpr bool IsTold(HazardState state) {
  return state == HazardState::kActive || state == HazardState::kVerifying;
}
/// "candidate", "active", "verifying", "gone" or "rejected".
constexpr const char* HazardStateName(HazardState state) {
  switch (state) {
    case HazardState::kCandidate:
      return "candidate";
    case HazardState::kActive:
      return "active";
    case HazardState::kVerifying:
      return "verifying";
    case HazardState::kGone:
      return "gone";
    case HazardState::kRejected:
      return "rejected";
  }
  return "unknown";
}

}  // namespace livemap::zone
