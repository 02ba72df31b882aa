#include "zone/life_record.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "base/sha256.h"

namespace livemap {
namespace {

constexpr std::size_t kMaxPackedBytes = 500;
constexpr std::uint32_t kAnswersToOpponent = 2;

template <typename Number>
void AppendNumber(std::string& line, Number number) {
  char digits[32];
  const auto end = std::to_chars(std::begin(digits), std::end(digits), number).ptr;
  if (!line.empty()) line.push_back(' ');
  line.append(digits, end);
}

/// Reads what AppendNumber wrote; once something is wrong it stays so.
class NumberReader {
 public:
  explicit NumberReader(std::string_view line) : rest_(line) {}

  template <typename Number>
  void Read(Number& number) {
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), number);
    if (error != std::errc()) return Fail();
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    if (rest_.empty()) return;
    if (rest_.front() != ' ' || rest_.size() == 1) return Fail();
    rest_.remove_prefix(1);
  }

  bool good() const { return good_; }
  bool done() const { return rest_.empty(); }

 private:
  void Fail() {
    good_ = false;
    rest_ = {};
  }

  std::string_view rest_;
  bool good_ = true;
};

bool IsSound(const LifeRecord& life) {
  const auto is_time = [](std::int64_t ns) { return ns >= 0; };
  return is_time(life.since_ns) && is_time(life.first_seen_ns) && is_time(life.last_yes_ns) &&
         is_time(life.first_no_ns) && is_time(life.at_ns) && std::abs(life.log_odds) <= 100 &&
         std::abs(life.undenied_log_odds) <= 100;
}

bool ReadVoices(NumberReader& reader, LifeRecord& life) {
  for (std::size_t i = 0; !reader.done(); ++i) {
    if (i == kMaxVoices) return false;
    Voice& voice = life.voices[i];
    unsigned against = 2;
    reader.Read(voice.vehicle);
    reader.Read(voice.at_s);
    reader.Read(voice.weight_1000);
    reader.Read(against);
    voice.against = against == 1;
    if (!reader.good() || against > 1 || voice.vehicle == 0) return false;
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

std::string PackLife(const LifeRecord& life) {
  std::string line;
  AppendNumber(line, static_cast<unsigned>(life.state));
  AppendNumber(line, life.official ? 1U : 0U);
  for (const std::int64_t ns :
       {life.since_ns, life.first_seen_ns, life.last_yes_ns, life.first_no_ns, life.at_ns}) {
    AppendNumber(line, ns);
  }
  AppendNumber(line, life.log_odds);
  AppendNumber(line, life.undenied_log_odds);
  for (const Voice& voice : life.voices) {
    if (voice.vehicle == 0) continue;
    AppendNumber(line, voice.vehicle);
    AppendNumber(line, voice.at_s);
    AppendNumber(line, voice.weight_1000);
    AppendNumber(line, voice.against ? 1U : 0U);
  }
  return line;
}

std::optional<LifeRecord> UnpackLife(const std::string& text) {
  if (text.size() > kMaxPackedBytes) return std::nullopt;
  NumberReader reader(text);
  LifeRecord life;
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
  if (!IsSound(life) || !ReadVoices(reader, life)) return std::nullopt;
  return life;
}

std::uint32_t Supporters(const LifeRecord& life) {
  return static_cast<std::uint32_t>(
      std::count_if(life.voices.begin(), life.voices.end(),
                    [](const Voice& voice) { return voice.vehicle != 0 && !voice.against; }));
}

std::uint32_t Opponents(const LifeRecord& life) {
  std::uint32_t opponents = 0;
  for (const Voice& voice : life.voices) {
    if (voice.vehicle == 0 || !voice.against) continue;
    const auto answers =
        std::count_if(life.voices.begin(), life.voices.end(), [&voice](const Voice& other) {
          return other.vehicle != 0 && !other.against && other.at_s > voice.at_s;
        });
    if (answers < kAnswersToOpponent) ++opponents;
  }
  return opponents;
}

}  // namespace livemap
