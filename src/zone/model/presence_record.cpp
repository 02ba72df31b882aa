#include "zone/model/presence_record.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "common/number_text.h"
#include "common/sha256.h"
#include "common/time.h"

namespace livemap::zone {
namespace {

constexpr std::size_t kMaxPackedBytes = 500;
constexpr std::uint32_t kAnswersToOpponent = 2;
constexpr double kMaxLogOdds = 20;  // As sure as nobody is; what a double can still turn back.
constexpr int kMaxWeight1000 = 10000;
// The last number of a packed voice.
constexpr unsigned kAgainst = 1;
constexpr unsigned kJudged = 2;
constexpr unsigned kSuspect = 4;

bool IsSoundPresence(const PresenceRecord& life) {
  return IsStamp(life.since_ns) && IsStamp(life.first_seen_ns) && IsStamp(life.last_yes_ns) &&
         IsStamp(life.first_no_ns) && IsStamp(life.at_ns) &&
         std::abs(life.log_odds) <= kMaxLogOdds && std::abs(life.undenied_log_odds) <= kMaxLogOdds;
}

bool ReadPresenceVoices(NumberReader& reader, PresenceRecord& life) {
  for (std::size_t i = 0; !reader.done(); ++i) {
    if (i == kMaxEvidencePerHazard) return false;
    VehicleEvidence& voice = life.voices[i];
    unsigned flags = ~0U;
    reader.Read(voice.vehicle);
    reader.Read(voice.at_s);
    reader.Read(voice.weight_1000);
    reader.Read(flags);
    if (!reader.good() || flags > (kAgainst | kJudged | kSuspect) || voice.vehicle == 0) {
      return false;
    }
    if (std::abs(int{voice.weight_1000}) > kMaxWeight1000) return false;
    voice.against = (flags & kAgainst) != 0;
    voice.suspect = (flags & kSuspect) != 0;
    life.SetJudged(i, (flags & kJudged) != 0);
    for (std::size_t j = 0; j < i; ++j) {
      if (life.voices[j].vehicle == voice.vehicle) return false;
    }
  }
  return true;
}

}  // namespace

std::uint64_t VehicleKey(const std::string& vehicle_id) {
  const std::string digits = Sha256Hex(vehicle_id).substr(0, 16);
  std::uint64_t key = 0;
  std::from_chars(digits.data(), digits.data() + digits.size(), key, 16);
  return std::max<std::uint64_t>(key, 1);
}

std::string PackPresence(const PresenceRecord& life) {
  std::string line;
  AppendNumber(line, static_cast<unsigned>(life.state));
  AppendNumber(line, life.official ? 1U : 0U);
  for (const std::int64_t ns :
       {life.since_ns, life.first_seen_ns, life.last_yes_ns, life.first_no_ns, life.at_ns}) {
    AppendNumber(line, ns);
  }
  AppendNumber(line, life.log_odds);
  AppendNumber(line, life.undenied_log_odds);
  for (std::size_t i = 0; i < kMaxEvidencePerHazard; ++i) {
    const VehicleEvidence& voice = life.voices[i];
    if (voice.vehicle == 0) continue;
    AppendNumber(line, voice.vehicle);
    AppendNumber(line, voice.at_s);
    AppendNumber(line, voice.weight_1000);
    AppendNumber(line, (voice.against ? kAgainst : 0) | (life.IsJudged(i) ? kJudged : 0) |
                           (voice.suspect ? kSuspect : 0));
  }
  return line;
}

std::optional<PresenceRecord> UnpackPresence(const std::string& text) {
  if (text.size() > kMaxPackedBytes) return std::nullopt;
  NumberReader reader(text);
  PresenceRecord life;
  unsigned state = kHazardStates;
  unsigned official = 2;
  reader.Read(state);
  reader.Read(official);
  for (std::int64_t* ns :
       {&life.since_ns, &life.first_seen_ns, &life.last_yes_ns, &life.first_no_ns, &life.at_ns}) {
    reader.Read(*ns);
  }
  reader.Read(life.log_odds);
  reader.Read(life.undenied_log_odds);
  if (!reader.good() || state >= kHazardStates || official > 1) return std::nullopt;
  life.state = static_cast<HazardState>(state);
  life.official = official == 1;
  if (!IsSoundPresence(life) || !ReadPresenceVoices(reader, life)) return std::nullopt;
  return life;
}

std::uint32_t Supporters(const PresenceRecord& life) {
  return static_cast<std::uint32_t>(
      std::count_if(life.voices.begin(), life.voices.end(),
                    [](const VehicleEvidence& voice) { return voice.Counts() && !voice.against; }));
}

std::uint64_t OnlyWitness(const PresenceRecord& life) {
  if (!IsOnMap(life.state) || life.official) return 0;
  std::uint64_t witness = 0;
  for (const VehicleEvidence& voice : life.voices) {
    if (voice.vehicle == 0 || voice.against) continue;
    if (witness != 0) return 0;
    witness = voice.vehicle;
  }
  return witness;
}

std::uint32_t Opponents(const PresenceRecord& life) {
  std::uint32_t opponents = 0;
  for (const VehicleEvidence& voice : life.voices) {
    if (!voice.Counts() || !voice.against) continue;
    const auto answers = std::count_if(
        life.voices.begin(), life.voices.end(), [&voice](const VehicleEvidence& other) {
          return other.Counts() && !other.against && other.at_s > voice.at_s;
        });
    if (answers < kAnswersToOpponent) ++opponents;
  }
  return opponents;
}

}  // namespace livemap::zone
