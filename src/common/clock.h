#pragma once

#include <chrono>
#include <cstdint>
#include <ctime>

namespace livemap {

/// Nanoseconds of a clock that never goes back; from an unknown start, for spans only.
inline std::int64_t SteadyNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// Nanoseconds of a clock that never goes back and also counts while the machine is suspended; from
/// an unknown start, for spans only.
inline std::int64_t BootNs() {
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

/// The moment of the steady clock `seconds` from now, at which a wait ends.
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
