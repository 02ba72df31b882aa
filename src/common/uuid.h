#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <string>

namespace livemap {

/// RFC 4122 UUID, bytes in network order. All zeros is the nil UUID.
struct Uuid {
  std::array<std::uint8_t, 16> bytes{};

  bool IsNil() const { return *this == Uuid{}; }
  /// "xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx", lower case.
  std::string ToString() const;
  /// Accepts exactly the form that ToString writes, in either case.
  static std::optional<Uuid> Parse(const std::string& text);
  /// Version 4 from the caller's generator, so that a test replays the same run.
  static Uuid Random(std::mt19937_64& generator);

  friend bool operator==(const Uuid& a, const Uuid& b) { return a.bytes == b.bytes; }
  friend bool operator!=(const Uuid& a, const Uuid& b) { return !(a == b); }
  friend bool operator<(const Uuid& a, const Uuid& b) { return a.bytes < b.bytes; }
};

/// A generator seeded from the system's entropy source with the full state width that UUIDs need.
std::mt19937_64 EntropySeededGenerator();

}  // namespace livemap

template <>
struct std::hash<livemap::Uuid> {
  std::size_t operator()(const livemap::Uuid& uuid) const noexcept;
};
