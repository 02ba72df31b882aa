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

/// Nanoseconds since 1970 (UTC) by the system's clock, never simulated time. May step back.
inline std::int64_t SystemNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace livemap
