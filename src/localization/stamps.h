#pragma once

#include <cmath>
#include <cstdint>

namespace livemap {

inline double Seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

inline std::int64_t Nanoseconds(double seconds) {
  return static_cast<std::int64_t>(std::llround(seconds * 1e9));
}

}  // namespace livemap
