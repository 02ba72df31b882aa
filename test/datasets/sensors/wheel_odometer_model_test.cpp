#include "datasets/sensors/wheel_odometer_model.h"

#include <gtest/gtest.h>

#include <cmath>

namespace livemap::datasets {
namespace {

TEST(WheelOdometerModel, ScaleErrorsOfManyVehiclesHaveOnePercentSigma) {
  double squares = 0;
  constexpr int kVehicles = 2000;
  for (int seed = 0; seed < kVehicles; ++seed) {
    const double error = WheelOdometerModel(static_cast<std::uint64_t>(seed)).scale() - 1;
    squares += error * error;
  }
  // Known to 1.6 %; bounds at 5 of them.
  EXPECT_NEAR(std::sqrt(squares / kVehicles) / 0.01, 1, 0.08);
}

TEST(WheelOdometerModel, MeasuresItsScaledSpeedWithTheVarianceItStates) {
  WheelOdometerModel odometer(4);
  double sum = 0;
  double squares = 0;
  double yaw_squares = 0;
  constexpr int kCount = 50000;
  WheelTwist twist;
  for (int i = 0; i < kCount; ++i) {
    twist = odometer.Measure(10, 0.1);
    sum += twist.speed_mps;
    const double off = twist.speed_mps - 10 * odometer.scale();
    squares += off * off;
    yaw_squares += (twist.yaw_rate_radps - 0.1) * (twist.yaw_rate_radps - 0.1);
  }
  EXPECT_NEAR(sum / kCount, 10 * odometer.scale(), 0.001);
  const double scale_variance = 0.01 * twist.speed_mps * 0.01 * twist.speed_mps;
  EXPECT_NEAR(squares / kCount / (twist.speed_variance - scale_variance), 1, 0.04);
  EXPECT_NEAR(yaw_squares / kCount / twist.yaw_rate_variance, 1, 0.04);
}

TEST(WheelOdometerModel, ReportsWholeStepsOfItsBus) {
  WheelOdometerModel odometer(4);
  for (int i = 0; i < 100; ++i) {
    const WheelTwist twist = odometer.Measure(0.1 * i + 1, 0.001 * i);
    EXPECT_NEAR(std::remainder(twist.speed_mps, 0.02), 0, 1e-9);
    EXPECT_NEAR(std::remainder(twist.yaw_rate_radps, 0.002), 0, 1e-9);
  }
}

TEST(WheelOdometerModel, StandingWheelReportsZero) {
  WheelOdometerModel odometer(4);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(odometer.Measure(0.001, 0).speed_mps, 0);
}

TEST(WheelOdometerModel, SameSeedSameValues) {
  WheelOdometerModel a(4);
  WheelOdometerModel b(4);
  WheelOdometerModel other(5);
  EXPECT_EQ(a.Measure(8, 0.1).speed_mps, b.Measure(8, 0.1).speed_mps);
  EXPECT_NE(a.scale(), other.scale());
}

}  // namespace
}  // namespace livemap::datasets
