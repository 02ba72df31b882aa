#pragma once

#include <cstddef>
#include <cstdint>
#include <set>

namespace livemap::zone {

/// Where a map change stands, as stored: the numbers never change.
/// docs/explanation/map-changes.md tells the steps.
enum class MapChangeState : std::uint8_t {
  kProposed = 0,   ///< One vehicle says so.
  kConfirmed = 1,  ///< Two vehicles say so, or an official.
  kUndone = 2,     ///< The opposite was told later.
  kDismissed = 3,  ///< An official says it is none.
};

constexpr std::size_t kMapChangeStates = 4;
using MapChangeStates = std::set<MapChangeState>;

/// Shown on the map; further words of vehicles change it.
constexpr bool IsOpen(MapChangeState state) {
  return state == MapChangeState::kProposed || state == MapChangeState::kConfirmed;
}
/// All of these.
inline const MapChangeStates& OpenStates() {
  static const MapChangeStates states{MapChangeState::kProposed, MapChangeState::kConfirmed};
  return states;
}
/// "proposed", "confirmed", "undone" or "dismissed".
constexpr const char* MapChangeStateName(MapChangeState state) {
  switch (state) {
    case MapChangeState::kProposed:
      return "proposed";
    case MapChangeState::kConfirmed:
      return "confirmed";
    case MapChangeState::kUndone:
      return "undone";
    case MapChangeState::kDismissed:
      return "dismissed";
  }
  return "unknown";
}

}  // namespace livemap::zone
