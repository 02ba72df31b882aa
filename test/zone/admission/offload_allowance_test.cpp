#include "zone/admission/offload_allowance.h"

#include <gtest/gtest.h>

#include "common/error.h"

namespace livemap::zone {
namespace {

constexpr std::int64_t kAllowanceSecondNs = 1'000'000'000;

OffloadAllowance::Config Small() {
  OffloadAllowance::Config config;
  config.frames_per_minute = 6;
  config.bytes_per_minute = 600;
  config.max_vehicles = 2;
  return config;
}

TEST(OffloadAllowance, FramesRefillEvenlyOverAMinute) {
  OffloadAllowance allowance(Small());
  for (int i = 0; i < 6; ++i) EXPECT_TRUE(allowance.Take("car-1", 1, 0));
  EXPECT_FALSE(allowance.Take("car-1", 1, 0));
  EXPECT_FALSE(allowance.Take("car-1", 1, 9 * kAllowanceSecondNs));
  EXPECT_TRUE(allowance.Take("car-1", 1, 11 * kAllowanceSecondNs));
}

TEST(OffloadAllowance, BytesAreLimitedToo) {
  OffloadAllowance allowance(Small());
  EXPECT_FALSE(allowance.Take("car-1", 601, 0));
  EXPECT_TRUE(allowance.Take("car-1", 600, 0)) << "a refused frame takes nothing";
  EXPECT_FALSE(allowance.Take("car-1", 100, 5 * kAllowanceSecondNs));
  EXPECT_TRUE(allowance.Take("car-1", 100, 11 * kAllowanceSecondNs));
}

TEST(OffloadAllowance, OneVehicleTakesNothingFromAnother) {
  OffloadAllowance allowance(Small());
  for (int i = 0; i < 100; ++i) allowance.Take("car-1", 100, 0);
  EXPECT_TRUE(allowance.Take("car-2", 100, 0));
}

TEST(OffloadAllowance, ManyIdsDoNotGrowItAndSilentOnesMakeRoom) {
  OffloadAllowance allowance(Small());
  EXPECT_TRUE(allowance.Take("car-1", 1, 0));
  EXPECT_TRUE(allowance.Take("car-2", 1, 30 * kAllowanceSecondNs));
  EXPECT_FALSE(allowance.Take("car-3", 1, 31 * kAllowanceSecondNs));
  EXPECT_TRUE(allowance.Take("car-3", 1, 61 * kAllowanceSecondNs));
  EXPECT_EQ(allowance.vehicles(), 2U);
}

TEST(OffloadAllowance, AClockThatIsSetBackTakesNothingAway) {
  OffloadAllowance allowance(Small());
  EXPECT_TRUE(allowance.Take("car-1", 1, 100 * kAllowanceSecondNs));
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(allowance.Take("car-1", 1, 0));
  EXPECT_FALSE(allowance.Take("car-1", 1, 0));
}

TEST(OffloadAllowance, CapsBelowOneAreRefused) {
  OffloadAllowance::Config config = Small();
  config.frames_per_minute = 0;
  EXPECT_THROW(OffloadAllowance{config}, Error);
}

}  // namespace
}  // namespace livemap::zone
