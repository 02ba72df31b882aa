#include "zone/belief/hazard_evidence.h"

#include <algorithm>
#include <utility>

#include "common/time.h"

namespace livemap::zone {
namespace {

/// The newest stamp of a vehicle that counts and speaks for the hazard; 0 without one.
std::uint32_t NewestEvidenceForS(const PresenceRecord& life) {
  std::uint32_t newest_s = 0;
  for (const VehicleEvidence& voice : life.voices) {
    if (voice.Counts() && !voice.against) newest_s = std::max(newest_s, voice.at_s);
  }
  return newest_s;
}

bool AnyEvidenceAgainst(const PresenceRecord& life) {
  return std::any_of(life.voices.begin(), life.voices.end(),
                     [](const VehicleEvidence& voice) { return voice.Counts() && voice.against; });
}

}  // namespace

VehicleEvidence* PlaceForEvidence(std::uint64_t vehicle, bool suspect, std::uint32_t at_s,
                                  PresenceRecord& life) {
  const auto keeps = [](const VehicleEvidence& voice) {
    return std::make_pair(voice.Counts(), voice.at_s);
  };
  VehicleEvidence* place = nullptr;
  for (VehicleEvidence& voice : life.voices) {
    if (voice.vehicle == vehicle) return &voice;
    if (place == nullptr || keeps(voice) < keeps(*place)) place = &voice;
  }
  if (place->Counts() && (suspect || place->at_s >= at_s)) return nullptr;
  if (place->vehicle != 0 && suspect && place->at_s >= at_s) return nullptr;
  *place = VehicleEvidence{vehicle, 0, 0, false, suspect};
  return place;
}

void RecordSupport(std::int64_t stamp_ns, PresenceRecord& life) {
  life.first_seen_ns = life.first_seen_ns == 0 ? stamp_ns : std::min(life.first_seen_ns, stamp_ns);
  life.last_yes_ns = std::max(life.last_yes_ns, stamp_ns);
  if (life.first_no_ns <= life.last_yes_ns) life.first_no_ns = 0;
}

void RecordDenial(std::int64_t stamp_ns, PresenceRecord& life) {
  if (stamp_ns <= life.last_yes_ns) return;
  life.first_no_ns = life.first_no_ns == 0 ? stamp_ns : std::min(life.first_no_ns, stamp_ns);
}

void ForgetStamps(const VehicleEvidence& taken, PresenceRecord& life) {
  if (taken.against) {
    if (!AnyEvidenceAgainst(life)) life.first_no_ns = 0;
    return;
  }
  if (static_cast<std::uint32_t>(std::max(0.0, Seconds(life.last_yes_ns))) > taken.at_s) return;
  life.last_yes_ns = std::max(life.first_seen_ns, Nanoseconds(NewestEvidenceForS(life)));
}

}  // namespace livemap::zone
