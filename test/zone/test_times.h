#pragma once

#include <cstdint>

namespace livemap::zone {

// Times of tests, in nanoseconds.
constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kHour = 3600 * kSecond;
constexpr std::int64_t kDay = 24 * kHour;
/// Since 1970: when most tests begin.
constexpr std::int64_t kStart = 1'700'000'000 * kSecond;

}  // namespace livemap::zone
