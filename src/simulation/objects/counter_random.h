#pragma once

#include <cstdint>

namespace livemap::simulation {

/// Mixes the bits of a number (finaliser of MurmurHash3): equal on every machine.
inline std::uint32_t HashBits(std::uint32_t x) {
  x ^= x >> 16U;
  x *= 0x85ebca6bU;
  x ^= x >> 13U;
  x *= 0xc2b2ae35U;
  return x ^ (x >> 16U);
}

/// Hash of a lattice point, quick enough for textures.
inline std::uint32_t HashLattice(std::int32_t x, std::int32_t y, std::uint32_t seed) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x9e3779b1U;
  h ^= static_cast<std::uint32_t>(y) * 0x85ebca77U;
  h += seed * 0xc2b2ae3dU;
  h = (h ^ (h >> 15U)) * 0x2c1b3c6dU;
  h = (h ^ (h >> 12U)) * 0x297a2d39U;
  return h ^ (h >> 15U);
}

/// [0, 1) with 24 bits.
inline float UnitFloat(std::uint32_t bits) {
  return static_cast<float>(bits >> 8U) * (1.0F / 16777216.0F);
}

/// Counter-based random numbers: the n-th number is a pure function of the key and n, so that what
/// is drawn for one thing never depends on another thing or on the order of threads.
class CounterRandom {
 public:
  CounterRandom(std::uint64_t seed, std::uint64_t stream, std::uint64_t item = 0)
      : key_(Mix(Mix(seed ^ 0x9e3779b97f4a7c15ULL) + stream * 0xd1342543de82ef95ULL) ^
             Mix(item + 0x2545f4914f6cdd1dULL)) {}

  std::uint64_t Bits() { return Mix(key_ + 0x9e3779b97f4a7c15ULL * ++counter_); }
  std::uint32_t Bits32() { return static_cast<std::uint32_t>(Bits() >> 32U); }
  /// Uniform in [low, high).
  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(Bits() >> 11U) / 9007199254740992.0;
  }
  float Uniform(float low, float high) {
    return static_cast<float>(Uniform(static_cast<double>(low), static_cast<double>(high)));
  }
  /// Uniform in 0..count-1; `count` is positive.
  int Index(int count) { return static_cast<int>(Uniform(0.0, static_cast<double>(count))); }
  bool Chance(double probability) { return Uniform(0.0, 1.0) < probability; }

  /// splitmix64's finaliser.
  static std::uint64_t Mix(std::uint64_t x) {
    x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31U);
  }

 private:
  std::uint64_t key_;
  std::uint64_t counter_ = 0;
};

}  // namespace livemap::simulation
