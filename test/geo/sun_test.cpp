#include "geo/sun.h"

#include <gtest/gtest.h>

namespace livemap::geo {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;

TEST(SunElevationDeg, StandsOverTheTropicAtTheSolstice) {
  // 2026-06-21 12:02 UTC, local noon in Greenwich's meridian.
  EXPECT_NEAR(SunElevationDeg({23.44, 0}, 1782043320 * kSecondNs), 90, 0.5);
}

TEST(SunElevationDeg, IsThatOfWinterInPittsburgh) {
  // 2026-12-21 17:18 UTC, solar noon: 90 - 40.44 - 23.44.
  EXPECT_NEAR(SunElevationDeg({40.4433, -79.9436}, 1797873480 * kSecondNs), 26.1, 0.3);
  EXPECT_LT(SunElevationDeg({40.4433, -79.9436}, 1797916680 * kSecondNs), -60);  // 12 h later.
}

TEST(SunElevationDeg, RisesAtSixAtTheEquinox) {
  // 2026-03-20 06:07 UTC at the equator.
  EXPECT_NEAR(SunElevationDeg({0, 0}, 1773986820 * kSecondNs), 0, 0.6);
}

}  // namespace
}  // namespace livemap::geo
