#include "common/uuid.h"

#include <cstring>

#include "common/number_text.h"

namespace livemap {
namespace {

bool IsUuidDash(std::size_t i) { return i == 8 || i == 13 || i == 18 || i == 23; }

}  // namespace

std::string Uuid::ToString() const {
  std::string text;
  text.reserve(36);
  for (const std::uint8_t byte : bytes) {
    if (IsUuidDash(text.size())) text += '-';
    AppendHex(text, byte);
  }
  return text;
}

std::optional<Uuid> Uuid::Parse(const std::string& text) {
  if (text.size() != 36) return std::nullopt;
  Uuid uuid;
  std::size_t nibble = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (IsUuidDash(i)) {
      if (text[i] != '-') return std::nullopt;
      continue;
    }
    const int value = HexValue(text[i]);
    if (value < 0) return std::nullopt;
    std::uint8_t& byte = uuid.bytes[nibble / 2];
    byte = static_cast<std::uint8_t>((byte << 4) | value);
    ++nibble;
  }
  return uuid;
}

Uuid Uuid::Random(std::mt19937_64& generator) {
  Uuid uuid;
  for (std::size_t i = 0; i < 16; i += 8) {
    const std::uint64_t word = generator();
    std::memcpy(&uuid.bytes[i], &word, sizeof(word));
  }
  uuid.bytes[6] = static_cast<std::uint8_t>((uuid.bytes[6] & 0x0f) | 0x40);
  uuid.bytes[8] = static_cast<std::uint8_t>((uuid.bytes[8] & 0x3f) | 0x80);
  return uuid;
}

std::mt19937_64 EntropySeededGenerator() {
  std::random_device entropy;
  std::seed_seq seed{entropy(), entropy(), entropy(), entropy(),
                     entropy(), entropy(), entropy(), entropy()};
  return std::mt19937_64(seed);
}

}  // namespace livemap

std::size_t std::hash<livemap::Uuid>::operator()(const livemap::Uuid& uuid) const noexcept {
  std::size_t value;
  std::memcpy(&value, uuid.bytes.data(), sizeof(value));
  return value;
}
