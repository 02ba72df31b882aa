#pragma once

#include <cstdint>

namespace livemap {

/// Within what a stamp of ROS can hold: 1970 to 2106. What is read from a file may be anything.
inline bool IsStamp(std::int64_t ns) { return ns >= 0 && ns < 4'294'967'295'000'000'000; }

}  // namespace livemap
