#pragma once

#include <chrono>
#include <cstdint>

namespace livemap {

/// Nanoseconds of a clock that never goes back; from an unknown start, for spans only.
inline std::int64_t SteadyNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// The moment of that clock `seconds` from now, at which a wait ends.
inline std::chrono::steady_clock::time_point SteadyDeadline(double seconds) {
  return std::chrono::steady_clock::now() + std::chrono::ceil<std::chrono::steady_clock::duration>(
                                                std::chrono::duration<double>(seconds));
}

/// Nanoseconds since 1970 (UTC) by the system's clock, never simulated time. May step back.
inline std::int64_t SystemNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace livemap
