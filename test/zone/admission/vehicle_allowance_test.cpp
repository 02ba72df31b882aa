#include "zone/admission/vehicle_allowance.h"

#include <gtest/gtest.h>

#include "common/error.h"
#include "test/zone/test_times.h"

namespace livemap::zone {
namespace {

VehicleAllowance::Config SmallCaps() {
  VehicleAllowance::Config config;
  config.reports_per_hour = 10;
  config.evidence_per_hour = 4;
  config.max_vehicles = 3;
  return config;
}

int Taken(VehicleAllowance& allowance, const std::string& vehicle, std::int64_t now_ns) {
  int taken = 0;
  for (int i = 0; i < 1000; ++i) taken += allowance.TakeReport(vehicle, now_ns) ? 1 : 0;
  return taken;
}

TEST(VehicleAllowance, TakesTheCapAtOnceAndThenNoMore) {
  VehicleAllowance allowance(SmallCaps());
  EXPECT_EQ(Taken(allowance, "a", kHour), 10);
  EXPECT_EQ(Taken(allowance, "a", kHour), 0);
}

TEST(VehicleAllowance, RefillsEvenlyOverTheHour) {
  VehicleAllowance allowance(SmallCaps());
  Taken(allowance, "a", kHour);
  EXPECT_EQ(Taken(allowance, "a", kHour + kHour / 2), 5);
  EXPECT_EQ(Taken(allowance, "a", kHour + 100 * kHour), 10) << "never more than the cap at once";
}

TEST(VehicleAllowance, ADayTakesAtMostTheCapPerHourAndOneHourMore) {
  VehicleAllowance allowance(SmallCaps());
  int taken = 0;
  for (int second = 0; second < 24 * 3600; second += 5) {
    taken += allowance.TakeReport("a", kHour + second * kSecond) ? 1 : 0;
  }
  EXPECT_LE(taken, 25 * 10);
  EXPECT_GE(taken, 24 * 10);
}

TEST(VehicleAllowance, VehiclesAndKindsDoNotShareTheirCaps) {
  VehicleAllowance allowance(SmallCaps());
  Taken(allowance, "a", kHour);
  EXPECT_TRUE(allowance.TakeReport("b", kHour));
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(allowance.TakeEvidence("a", kHour));
  EXPECT_FALSE(allowance.TakeEvidence("a", kHour));
}

TEST(VehicleAllowance, MemoryIsBoundedAndNobodyGetsAFreshCapByItsBeingFull) {
  VehicleAllowance allowance(SmallCaps());
  for (const char* vehicle : {"a", "b", "c"}) Taken(allowance, vehicle, kHour);
  for (int i = 0; i < 1000; ++i) {
    EXPECT_FALSE(allowance.TakeReport("x" + std::to_string(i), kHour + kSecond));
  }
  EXPECT_EQ(allowance.vehicles(), 3u);
  EXPECT_EQ(Taken(allowance, "a", kHour + kSecond), 0);
}

TEST(VehicleAllowance, AVehicleSilentForAnHourMakesRoomForANewOne) {
  VehicleAllowance allowance(SmallCaps());
  for (const char* vehicle : {"a", "b", "c"}) Taken(allowance, vehicle, kHour);
  EXPECT_TRUE(allowance.TakeReport("d", 2 * kHour));
  EXPECT_EQ(allowance.vehicles(), 3u);
}

TEST(VehicleAllowance, AClockThatStepsBackNeitherGivesNorTakes) {
  VehicleAllowance allowance(SmallCaps());
  EXPECT_EQ(Taken(allowance, "a", 5 * kHour), 10);
  EXPECT_EQ(Taken(allowance, "a", 1 * kHour), 0);
  EXPECT_EQ(Taken(allowance, "a", 5 * kHour), 0);
}

TEST(VehicleAllowance, RefusesCapsBelowOne) {
  VehicleAllowance::Config config;
  config.evidence_per_hour = 0;
  EXPECT_THROW(VehicleAllowance{config}, Error);
}

}  // namespace
}  // namespace livemap::zone
