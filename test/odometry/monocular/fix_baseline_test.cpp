#include "odometry/monocular/fix_baseline.h"

#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <vector>

#include "common/time.h"
#include "geo/wgs84.h"

namespace livemap::odometry {
namespace {

constexpr std::int64_t kBaselineBeginNs = 1'700'000'000'000'000'000;
constexpr double kMetresPerUnit = 2.5;
constexpr double kBaselineMps = 8;

std::int64_t BaselineStamp(double seconds) { return kBaselineBeginNs + Nanoseconds(seconds); }

/// A vehicle that drives straight on, with a fix and a pose every tenth of a second.
struct BaselineDrive {
  explicit BaselineDrive(double sigma) : sigma_m(sigma) {}

  void Go(double until_s, double mps, FixBaseline& baseline,
          std::vector<FixBaseline::Measurement>& measured) {
    for (; time_s < until_s; time_s += 0.1) {
      way_m += 0.1 * mps;
      geo::Fix fix;
      fix.stamp_ns = BaselineStamp(time_s);
      fix.position = geo::LocalFrame({48.8566, 9.0})
                         .ToGeo({way_m + noise(random) * sigma_m, noise(random) * sigma_m});
      fix.covariance_m2 = sigma_m * sigma_m * Eigen::Matrix2d::Identity();
      baseline.AddFix(fix);
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.translation().z() = way_m / kMetresPerUnit;
      baseline.AddPose(BaselineStamp(time_s), pose);
      while (const auto one = baseline.Measure()) measured.push_back(*one);
    }
  }

  double sigma_m;
  double time_s = 0, way_m = 0;
  std::mt19937 random{1};
  std::normal_distribution<double> noise;
};

TEST(FixBaseline, MeasuresTheUnitOverWaysThatAreLongAgainstTheFixesErrors) {
  FixBaseline baseline({});
  BaselineDrive drive(1.0);
  std::vector<FixBaseline::Measurement> measured;
  drive.Go(60, kBaselineMps, baseline, measured);
  ASSERT_GE(measured.size(), 10U);
  double squares = 0;
  for (const auto& one : measured) {
    EXPECT_GT(one.metres, 15);
    const double error = (one.metres - kMetresPerUnit * one.units) / one.sigma_m;
    squares += error * error;
  }
  const double mean = squares / static_cast<double>(measured.size());
  EXPECT_GT(mean, 0.3) << "as uncertain as it says";
  EXPECT_LT(mean, 2.5);
}

TEST(FixBaseline, AWayMayBeginInOneUnitAndEndInAnother) {
  FixBaseline baseline({});
  const auto fix_at = [](int i) {
    geo::Fix fix;
    fix.stamp_ns = BaselineStamp(i);
    fix.position = geo::LocalFrame({48.8566, 9.0}).ToGeo({0, 10.0 * i});
    fix.covariance_m2 = 0.01 * Eigen::Matrix2d::Identity();
    return fix;
  };
  const auto pose_at = [](double z) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation().z() = z;
    return pose;
  };
  // 10 m are 4 units; poses come between the fixes, too.
  for (int i = 0; i <= 3; ++i) baseline.AddPose(BaselineStamp(0.5 * i), pose_at(2.0 * i));
  baseline.AddFix(fix_at(0));
  baseline.AddFix(fix_at(1));
  const auto first = baseline.Measure();
  ASSERT_TRUE(first);
  EXPECT_NEAR(first->metres / first->units, kMetresPerUnit, 1e-3);
  baseline.Stretch(kMetresPerUnit);
  baseline.AddPose(BaselineStamp(2), pose_at(20));
  baseline.AddFix(fix_at(2));
  const auto second = baseline.Measure();
  ASSERT_TRUE(second);
  EXPECT_NEAR(second->metres / second->units, 1, 1e-3);
}

TEST(FixBaseline, AStandingVehicleTellsNothing) {
  FixBaseline baseline({});
  BaselineDrive drive(1.0);
  std::vector<FixBaseline::Measurement> measured;
  drive.Go(120, 0, baseline, measured);
  EXPECT_TRUE(measured.empty());
}

TEST(FixBaseline, AFixMayComeBeforeThePoseOfItsMomentAndBetweenTwo) {
  FixBaseline baseline({});
  std::optional<FixBaseline::Measurement> measured;
  for (int i = 0; i <= 20; ++i) {
    geo::Fix fix;
    fix.stamp_ns = BaselineStamp(0.2 * i + 0.05);
    fix.position = geo::LocalFrame({48.8566, 9.0}).ToGeo({8 * (0.2 * i + 0.05), 0});
    fix.covariance_m2 = 1e-4 * Eigen::Matrix2d::Identity();
    baseline.AddFix(fix);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation().z() = 8 * 0.2 * i / kMetresPerUnit;
    baseline.AddPose(BaselineStamp(0.2 * i), pose);
    if (const auto one = baseline.Measure()) measured = one;
  }
  ASSERT_TRUE(measured);
  EXPECT_NEAR(measured->metres / measured->units, kMetresPerUnit, 0.001);
}

TEST(FixBaseline, AfterAResetNothingOfBeforeCounts) {
  FixBaseline baseline({});
  BaselineDrive drive(0.1);
  std::vector<FixBaseline::Measurement> measured;
  drive.Go(0.25, kBaselineMps, baseline, measured);
  baseline.Reset();
  geo::Fix far;
  far.stamp_ns = BaselineStamp(0.3);
  far.position = geo::LocalFrame({48.8566, 9.0}).ToGeo({1000, 0});
  baseline.AddFix(far);
  baseline.AddPose(BaselineStamp(0.3), Eigen::Isometry3d::Identity());
  EXPECT_FALSE(baseline.Measure());
}

}  // namespace
}  // namespace livemap::odometry
