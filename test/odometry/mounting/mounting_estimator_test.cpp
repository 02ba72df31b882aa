#include "odometry/mounting/mounting_estimator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "test/odometry/mounting/synthetic_road.h"

namespace livemap::odometry {
namespace {

const Mounting kTruth{Radians(-3), Radians(4.5), Radians(2), 1.72};

/// Steps of half a metre, a road every metre, both with noise; each hundredth step is far off.
class NoisyDrive {
 public:
  explicit NoisyDrive(unsigned seed) : random_(seed) {}

  void Go(MountingEstimator& estimator, const Mounting& truth, double way_m, bool road = true) {
    for (int i = 0; i < static_cast<int>(2 * way_m); ++i) {
      Mounting step = truth;
      step.yaw_rad += Noise(0.006);
      step.pitch_rad += Noise(0.008) + 0.002 * std::sin(0.4 * i);
      if (i % 100 == 50) step.pitch_rad += 0.3;
      estimator.AddTravel(0.5 * AxesInCamera(step).forward, 0.5);
      if (!road || i % 2 == 1) continue;
      Mounting plane = truth;
      plane.pitch_rad += Noise(0.008);
      plane.roll_rad += Noise(0.01);
      estimator.AddRoad({AxesInCamera(plane).down, truth.height_m * (1 + Noise(0.015))}, 0);
    }
  }

  double Noise(double sigma) { return std::normal_distribution<double>(0, sigma)(random_); }

 private:
  std::mt19937 random_;
};

double SquaredErrors(const MountingEstimate& estimate, const Mounting& truth) {
  const auto square = [](double error, double sigma) { return error * error / (sigma * sigma); };
  return (square(estimate.mounting.yaw_rad - truth.yaw_rad, estimate.sigma.yaw_rad) +
          square(estimate.mounting.pitch_rad - truth.pitch_rad, estimate.sigma.pitch_rad) +
          square(estimate.mounting.roll_rad - truth.roll_rad, estimate.sigma.roll_rad) +
          square(estimate.mounting.height_m - truth.height_m, estimate.sigma.height_m)) /
         4;
}

TEST(MountingEstimator, FindsAnglesAndHeightAmongNoiseAndOutliers) {
  MountingEstimator estimator({});
  NoisyDrive(1).Go(estimator, kTruth, 400);
  const auto estimate = estimator.Estimate({});
  ASSERT_TRUE(estimate && estimate->roll_known && estimate->height_known);
  EXPECT_NEAR(estimate->mounting.yaw_rad, kTruth.yaw_rad, Radians(0.1));
  EXPECT_NEAR(estimate->mounting.pitch_rad, kTruth.pitch_rad, Radians(0.1));
  EXPECT_NEAR(estimate->mounting.roll_rad, kTruth.roll_rad, Radians(0.15));
  EXPECT_NEAR(estimate->mounting.height_m, kTruth.height_m, 0.01);
  EXPECT_FALSE(estimator.TakeKnock());
}

TEST(MountingEstimator, StatesStandardDeviationsThatTheErrorsHave) {
  MountingEstimator::Config config;
  config.angle_floor_rad = 1e-5;  // Nothing here errs alike in all blocks.
  config.height_floor = 1e-5;
  double sum = 0;
  constexpr int kDrives = 60;
  for (unsigned seed = 1; seed <= kDrives; ++seed) {
    MountingEstimator estimator(config);
    NoisyDrive(seed).Go(estimator, kTruth, 500);
    const auto estimate = estimator.Estimate({});
    ASSERT_TRUE(estimate);
    sum += SquaredErrors(*estimate, kTruth) / kDrives;
  }
  EXPECT_GT(sum, 0.3);  // The prior of few blocks is somewhat wide.
  EXPECT_LT(sum, 1.5);
}

TEST(MountingEstimator, SaysNothingBeforeAFewBlocksAndKnowsNoRollWithoutARoad) {
  MountingEstimator estimator({});
  EXPECT_FALSE(estimator.Estimate({}));
  NoisyDrive drive(2);
  drive.Go(estimator, kTruth, 40, false);
  EXPECT_FALSE(estimator.Estimate({}));
  drive.Go(estimator, kTruth, 30, false);
  const auto estimate = estimator.Estimate({0, 0, Radians(1), 1.3});
  ASSERT_TRUE(estimate);
  EXPECT_FALSE(estimate->roll_known);
  EXPECT_FALSE(estimate->height_known);
  EXPECT_NEAR(estimate->mounting.pitch_rad, kTruth.pitch_rad, Radians(0.5));
  EXPECT_EQ(estimate->mounting.height_m, 1.3);
  EXPECT_TRUE(std::isinf(estimate->sigma.roll_rad));
  EXPECT_TRUE(std::isinf(estimate->sigma.height_m));
}

TEST(MountingEstimator, TellsAKnockOnceAndStartsAnew) {
  MountingEstimator estimator({});
  NoisyDrive drive(3);
  drive.Go(estimator, kTruth, 2000);
  EXPECT_FALSE(estimator.TakeKnock());
  Mounting after = kTruth;
  after.pitch_rad += Radians(1.5);
  after.yaw_rad -= Radians(2);
  drive.Go(estimator, after, 100);
  const auto knock = estimator.TakeKnock();
  ASSERT_TRUE(knock);
  EXPECT_NEAR(knock->before.pitch_rad, kTruth.pitch_rad, Radians(0.1));
  EXPECT_NEAR(knock->after.yaw_rad, after.yaw_rad, Radians(0.5));
  EXPECT_FALSE(estimator.TakeKnock());
  drive.Go(estimator, after, 300);
  const auto estimate = estimator.Estimate({});
  ASSERT_TRUE(estimate);
  EXPECT_NEAR(estimate->mounting.pitch_rad, after.pitch_rad, Radians(0.15));
  EXPECT_NEAR(estimate->mounting.yaw_rad, after.yaw_rad, Radians(0.15));
  EXPECT_FALSE(estimator.TakeKnock());
}

TEST(MountingEstimator, TakesALowerCameraForAKnockToo) {
  MountingEstimator estimator({});
  NoisyDrive drive(4);
  drive.Go(estimator, kTruth, 300);
  Mounting after = kTruth;
  after.height_m -= 0.2;
  drive.Go(estimator, after, 100);
  const auto knock = estimator.TakeKnock();
  ASSERT_TRUE(knock);
  EXPECT_NEAR(knock->after.height_m, after.height_m, 0.03);
}

TEST(MountingEstimator, TakesNewMetresForNoKnock) {
  // As after a start anew of one eye: all that it sees is a tenth longer, within what it states.
  for (const double metres_sigma : {0.05, 0.005}) {
    MountingEstimator estimator({});
    for (int i = 0; i < 600; ++i) {
      const double metres = i < 400 ? 1 : 1.1;
      estimator.AddTravel(AxesInCamera(kTruth).forward, 0.5);
      estimator.AddRoad({AxesInCamera(kTruth).down, metres * kTruth.height_m}, metres_sigma);
    }
    EXPECT_EQ(estimator.TakeKnock().has_value(), metres_sigma < 0.01) << metres_sigma;
  }
}

TEST(MountingEstimator, TellsNoKnockInFiftyQuietDrives) {
  for (unsigned seed = 100; seed < 150; ++seed) {
    MountingEstimator estimator({});
    NoisyDrive(seed).Go(estimator, kTruth, 1000);
    EXPECT_FALSE(estimator.TakeKnock()) << seed;
  }
}

TEST(MountingEstimator, StatesNoSurerHeightThanItsMetresAre) {
  MountingEstimator estimator({});
  for (int i = 0; i < 400; ++i) {
    estimator.AddTravel(AxesInCamera(kTruth).forward, 0.5);
    estimator.AddRoad({AxesInCamera(kTruth).down, kTruth.height_m}, 0.05);
  }
  const auto estimate = estimator.Estimate({});
  ASSERT_TRUE(estimate && estimate->height_known);
  EXPECT_GT(estimate->sigma.height_m, 0.02 * kTruth.height_m);
  MountingEstimator by_height({});
  for (int i = 0; i < 400; ++i) {
    by_height.AddTravel(AxesInCamera(kTruth).forward, 0.5);
    by_height.AddRoad({AxesInCamera(kTruth).down, 1}, std::numeric_limits<double>::infinity());
  }
  ASSERT_TRUE(by_height.Estimate({}));
  EXPECT_TRUE(by_height.Estimate({})->roll_known);
  EXPECT_FALSE(by_height.Estimate({})->height_known);
}

TEST(MountingEstimator, IgnoresWhatIsNoDirectionOrNoRoad) {
  MountingEstimator estimator({});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {nan, -1.0, 0.0, std::numeric_limits<double>::infinity()}) {
    estimator.AddTravel({0, 0, bad}, 20);
    estimator.AddTravel({0, 0, 1}, bad);
    estimator.AddRoad({{0, bad, 0}, 1.5}, 0);
    estimator.AddRoad({{0, 1, 0}, bad}, 0);
  }
  EXPECT_EQ(estimator.blocks(), 0U);
  EXPECT_FALSE(estimator.Estimate({}));
}

}  // namespace
}  // namespace livemap::odometry
