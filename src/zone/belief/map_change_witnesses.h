#pragma once

#include <optional>
#include <string>
#include <vector>

#include "zone/model/map_change.h"

namespace livemap::zone {

/// What a further word of a vehicle adds to those that spoke.
enum class WitnessUpdate {
  kNewVehicle,
  kNewDrive,   ///< Of a vehicle that spoke before.
  kSameDrive,  ///< Counts for no more.
  kTooMany,    ///< kMaxWitnesses vehicles are known on that side: it is not counted.
};

/// Notes that a drive of a vehicle spoke for the change, or against it. Both keys by VehicleKey.
WitnessUpdate RecordWitness(std::vector<MapChangeWitness>& witnesses, std::uint64_t vehicle,
                            std::uint64_t drive, bool against);

/// The witnesses as one line of numbers, and back; none when the text is no such line.
std::string PackWitnesses(const std::vector<MapChangeWitness>& witnesses);
std::optional<std::vector<MapChangeWitness>> UnpackWitnesses(const std::string& text);

/// No packed line is longer.
constexpr std::size_t kMaxPackedWitnessBytes = 4096;

}  // namespace livemap::zone
