#pragma once

#include <cstdint>

#include "protocol/hazard_catalogue.h"
#include "zone/belief/survival_model.h"
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
  double hostile = 0;
};

/// What HazardLifecycle knows of a hazard's class; made by ClassModelOf, cheap to copy.
struct ClassModel {
  std::uint32_t confirmations =
      2;  ///< Distinct vehicles before drivers are told, 1 to kMaxEvidencePerHazard.
  double hit_rate = 0.85;    ///< P(a vehicle that looks says yes | it is there).
  double false_rate = 0.03;  ///< P(the same | it is not there).
  ClassSurvival survival;
};
ClassModel ClassModelOf(const protocol::HazardClass& entry, const ClassSurvival& survival);

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
