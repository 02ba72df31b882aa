#include "odometry/monocular/vehicle_speed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/time.h"
#include "geo/wgs84.h"

namespace livemap::odometry {
namespace {

constexpr std::int64_t kSpeedBeginNs = 1'700'000'000'000'000'000;
constexpr geo::GeoPoint kSpeedPlace = {48.8566, 9.0};

std::int64_t SpeedStamp(double seconds) { return kSpeedBeginNs + Nanoseconds(seconds); }

/// A fix of a vehicle that has gone `way_m` to the east.
geo::Fix FixAfter(double seconds, double way_m, double sigma_m = 1.0) {
  geo::Fix fix;
  fix.stamp_ns = SpeedStamp(seconds);
  fix.position = geo::LocalFrame(kSpeedPlace).ToGeo({way_m, 0});
  fix.covariance_m2 = sigma_m * sigma_m * Eigen::Matrix2d::Identity();
  return fix;
}

TEST(VehicleSpeed, TheWheelsGoBeforeTheReceiverAndThatBeforeFixes) {
  VehicleSpeed speed({});
  EXPECT_FALSE(speed.At(SpeedStamp(0)));
  for (int i = 0; i <= 30; ++i) speed.AddFix(FixAfter(0.1 * i, 0.8 * i));
  ASSERT_TRUE(speed.At(SpeedStamp(3)));
  EXPECT_EQ(speed.At(SpeedStamp(3))->source, MetresSource::kFixes);
  EXPECT_NEAR(speed.At(SpeedStamp(3))->mps, 8, 1e-6);
  speed.AddSpeed(MetresSource::kReceiver, SpeedStamp(3), 8.1, 0.2);
  EXPECT_EQ(speed.At(SpeedStamp(3))->source, MetresSource::kReceiver);
  EXPECT_NEAR(speed.At(SpeedStamp(3))->sigma_mps, 0.2, 1e-9);
  speed.AddSpeed(MetresSource::kWheels, SpeedStamp(3), -8.2, 0.1);
  EXPECT_EQ(speed.At(SpeedStamp(3))->source, MetresSource::kWheels);
  EXPECT_NEAR(speed.At(SpeedStamp(3))->mps, 8.2, 1e-9) << "backwards is a speed, too";
}

TEST(VehicleSpeed, ASourceThatFallsSilentGivesWayToTheNextAndThenToNone) {
  VehicleSpeed speed({});
  speed.AddSpeed(MetresSource::kWheels, SpeedStamp(0), 5, 0.1);
  for (int i = 0; i <= 10; ++i) {
    speed.AddSpeed(MetresSource::kReceiver, SpeedStamp(0.1 * i), 5, 0.2);
  }
  EXPECT_EQ(speed.At(SpeedStamp(0.5))->source, MetresSource::kWheels);
  EXPECT_EQ(speed.At(SpeedStamp(1.2))->source, MetresSource::kReceiver);
  EXPECT_GT(speed.At(SpeedStamp(1.2))->sigma_mps, 0.2) << "what it did since nobody measured";
  EXPECT_FALSE(speed.At(SpeedStamp(2)));
}

TEST(VehicleSpeed, BetweenTwoSpeedsItIsBetweenThem) {
  VehicleSpeed speed({});
  speed.AddSpeed(MetresSource::kReceiver, SpeedStamp(0), 4, 0.2);
  speed.AddSpeed(MetresSource::kReceiver, SpeedStamp(0.2), 6, 0.2);
  EXPECT_NEAR(speed.At(SpeedStamp(0.05))->mps, 4.5, 1e-6);
}

TEST(VehicleSpeed, TheSpeedOfFixesIsAsUncertainAsTheyAre) {
  VehicleSpeed rough({}), fine({});
  for (int i = 0; i <= 20; ++i) {
    rough.AddFix(FixAfter(0.1 * i, 0.8 * i, 2.0));
    fine.AddFix(FixAfter(0.1 * i, 0.8 * i, 0.02));
  }
  EXPECT_NEAR(rough.At(SpeedStamp(1))->sigma_mps, std::sqrt(2.0), 0.1) << "2 m twice over 2 s";
  EXPECT_LT(fine.At(SpeedStamp(1))->sigma_mps, 0.06);
}

TEST(VehicleSpeed, WhatCannotBeIsPassedOver) {
  VehicleSpeed speed({});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(speed.AddSpeed(MetresSource::kReceiver, SpeedStamp(0), nan, 0.1));
  EXPECT_FALSE(speed.AddSpeed(MetresSource::kReceiver, SpeedStamp(0), 5, nan));
  EXPECT_FALSE(speed.AddSpeed(MetresSource::kReceiver, SpeedStamp(0), 500, 0.1));
  EXPECT_TRUE(speed.AddSpeed(MetresSource::kReceiver, SpeedStamp(1), 5, 0.1));
  EXPECT_FALSE(speed.AddSpeed(MetresSource::kReceiver, SpeedStamp(1), 6, 0.1)) << "not later";
  geo::Fix none = FixAfter(1, 0);
  none.has_fix = false;
  EXPECT_FALSE(speed.AddFix(none));
}

}  // namespace
}  // namespace livemap::odometry
