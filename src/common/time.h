#pragma once

#include <cmath>
#include <cstdint>

namespace livemap {

/// Stamps of ROS and of our records are nanoseconds; this is one, or a span of them, in seconds.
inline double Seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

/// To the nearest; seconds within +-292 years.
inline std::int64_t Nanoseconds(double seconds) {
  return static_cast<std::int64_t>(std::llround(seconds * 1e9));
}

/// Within what a stamp of ROS can hold: 1970 to 2106. What is read from a file may be anything.
inline bool IsStamp(std::int64_t ns) { return ns >= 0 && ns < 4'294'967'295'000'000'000; }

}  // namespace livemap
