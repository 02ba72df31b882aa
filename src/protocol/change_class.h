#pragma once

#include <array>
#include <cstdint>

namespace livemap::protocol {

/// What changed between two drives down one street, the ten classes of VL-CMU-CD. The values are
/// those of the masks and the order is that of the channels of a prediction.
enum class ChangeClass : std::uint8_t {
  kNoChange = 0,
  kBarrier,
  kBin,
  kConstruction,
  kOtherObjects,
  kPersonCycle,
  kRubbish,
  kSign,
  kTrafficCone,
  kVehicle,
};
constexpr int kChangeClasses = 10;

/// Where a mask of directions (GT_direction) says that the later drive has what the earlier one has
/// not, and the other way round; 0: nothing changed.
constexpr std::uint8_t kAppearedPixel = 1;
constexpr std::uint8_t kVanishedPixel = 2;

/// "no_change", "barrier", ..., "vehicle".
const char* ChangeClassName(ChangeClass change_class);
/// Red, green, blue as the published ground truth paints it, white for no change.
std::array<std::uint8_t, 3> ChangeClassColour(ChangeClass change_class);

}  // namespace livemap::protocol
