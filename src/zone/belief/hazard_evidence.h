#pragma once

#include <cstdint>

#include "zone/belief/class_model.h"
#include "zone/model/presence_record.h"

namespace livemap::zone {

enum class EvidenceKind : std::uint8_t {
  kSighting,   ///< A report.
  kAnswerYes,  ///< To a poll, by a vehicle that could see the place.
  kAnswerNo,   ///< The same.
  kCantSee,    ///< Counts nothing.
};

/// What one vehicle says of one hazard.
struct Evidence {
  EvidenceKind kind = EvidenceKind::kSighting;
  std::uint64_t vehicle = 0;  ///< VehicleKey.
  std::int64_t stamp_ns = 0;  ///< Of the image.
  /// P(its vehicle says what it likes), of VehicleTrust; `malicious_share` at least.
  double malicious = 0;
};

/// The vehicle's place in the hazard's record: its own, a free one, or that of the longest silent,
/// if it has been silent since before `at_s`. A vehicle that does not count goes before one that
/// does, and drives none away that does; null where it has no place.
VehicleEvidence* PlaceForEvidence(std::uint64_t vehicle, bool suspect, std::uint32_t at_s,
                                  PresenceRecord& life);
/// Notes when the hazard was seen, and when it was denied.
void RecordSupport(std::int64_t stamp_ns, PresenceRecord& life);
void RecordDenial(std::int64_t stamp_ns, PresenceRecord& life);
/// Makes those times what they were, had the vehicle of `taken`, which `life` no longer holds,
/// given no evidence.
void ForgetStamps(const VehicleEvidence& taken, PresenceRecord& life);

}  // namespace livemap::zone
