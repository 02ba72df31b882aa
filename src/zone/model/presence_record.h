#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "zone/model/hazard_state.h"

namespace livemap::zone {

/// A vehicle in the records of hazards: the first 8 bytes of the SHA-256 of its proven id, the same
/// after a restart. Never 0.
std::uint64_t VehicleKey(const std::string& vehicle_id);

/// What one vehicle said of one hazard so far.
struct VehicleEvidence {
  std::uint64_t vehicle = 0;  ///< VehicleKey; 0: nobody.
  std::uint32_t at_s = 0;     ///< Newest stamp that counted, UTC seconds since 1970.
  /// How much the vehicle moves the hazard's log odds, thousandths; > 0 towards there.
  std::int16_t weight_1000 = 0;
  bool against = false;  ///< Its newest word was that the hazard is not there.
  /// When it said so the zone did not believe the vehicle enough to count it as one.
  bool suspect = false;

  bool Counts() const { return vehicle != 0 && !suspect; }
};

/// Vehicles that a hazard remembers; a further one takes the place of the longest silent.
constexpr std::size_t kMaxEvidencePerHazard = 6;

/// The life of one hazard: plain data of 160 bytes, changed by HazardLifecycle only. Times are UTC,
/// ns since 1970.
struct PresenceRecord {
  HazardState state = HazardState::kCandidate;
  bool official = false;           ///< Confirmed by an official: needs no further vehicle.
  std::uint8_t judged = 0;         ///< Bit i: the newest word of voice i had its verdict.
  std::int64_t since_ns = 0;       ///< In this state since, zone clock.
  std::int64_t first_seen_ns = 0;  ///< Oldest stamp that spoke for it.
  std::int64_t last_yes_ns = 0;    ///< Newest stamp that spoke for it.
  std::int64_t first_no_ns = 0;    ///< Oldest stamp against it after that; 0 without one.
  std::int64_t at_ns = 0;          ///< The odds are of this moment.
  double log_odds = 0;             ///< ln(p / (1 - p)) of its being there.
  double undenied_log_odds = 0;    ///< The same had nobody spoken against it.
  std::array<VehicleEvidence, kMaxEvidencePerHazard> voices{};

  bool IsJudged(std::size_t voice) const { return (judged >> voice & 1U) != 0; }
  void SetJudged(std::size_t voice, bool is_judged) {
    const unsigned bit = 1U << voice;
    judged = static_cast<std::uint8_t>(is_judged ? judged | bit : judged & ~bit);
  }
};

/// One line of plain numbers with spaces between, at most 500 bytes, to be stored; exact.
std::string PackPresence(const PresenceRecord& life);
/// Inverse of PackPresence; none when `text` is anything else.
std::optional<PresenceRecord> UnpackPresence(const std::string& text);

/// Vehicles that count whose newest word is for the hazard; at most kMaxEvidencePerHazard.
std::uint32_t Supporters(const PresenceRecord& life);
/// The vehicle on whose word alone a hazard on the map rests: no other vehicle's newest word is for
/// it, and no official has confirmed it. 0 without one.
std::uint64_t OnlyWitness(const PresenceRecord& life);
/// Vehicles that count whose newest word is against it, and has not been answered by two others
/// since, that spoke for it.
std::uint32_t Opponents(const PresenceRecord& life);

}  // namespace livemap::zone
