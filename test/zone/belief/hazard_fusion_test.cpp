#include "zone/belief/hazard_fusion.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <random>

namespace livemap::zone {
namespace {

constexpr geo::GeoPoint kFusedPlace{40.44, -79.94};

protocol::Report ReportAt(const Eigen::Vector2d& east_north_m, const Eigen::Matrix2d& covariance) {
  protocol::Report report;
  report.position = geo::LocalFrame(kFusedPlace).ToGeo(east_north_m);
  report.covariance_m2 = covariance;
  report.confidence = 0.5F;
  report.stamp_ns = 1;
  return report;
}

HazardEstimate FirstEstimate(const protocol::Report& report) {
  HazardEstimate estimate;
  estimate.position = report.position;
  estimate.covariance_m2 = report.covariance_m2;
  return estimate;
}

Eigen::Vector2d PlaceOf(const HazardEstimate& estimate) {
  return geo::LocalFrame(kFusedPlace).ToEnu(estimate.position);
}

TEST(HazardFusion, EqualReportsAverageButForWhatTheyShare) {
  const FusionRule rule;
  const Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity() * 4.0;
  HazardEstimate estimate = FirstEstimate(ReportAt({0, 0}, covariance));
  for (int n = 2; n <= 8; ++n) {
    Fuse(estimate, ReportAt({static_cast<double>(n - 1), 0}, covariance), rule);
    const double expected = rule.common_share + (1 - rule.common_share) / n;
    EXPECT_NEAR(estimate.covariance_m2(0, 0), 4.0 * expected, 1e-6) << n;
    EXPECT_NEAR(PlaceOf(estimate).x(), (n - 1) / 2.0, 1e-4) << "the mean of " << n;
  }
}

TEST(HazardFusion, AVagueReportDoesNotSpoilASurePlace) {
  HazardEstimate estimate = FirstEstimate(ReportAt({0, 0}, Eigen::Matrix2d::Identity() * 0.1));
  Fuse(estimate, ReportAt({4, 0}, Eigen::Matrix2d::Identity() * 100), {});
  EXPECT_LT(PlaceOf(estimate).norm(), 0.05);
  EXPECT_LE(estimate.covariance_m2(0, 0), 0.1);
  EXPECT_GT(estimate.covariance_m2(0, 0), 0.08);
}

TEST(HazardFusion, WhatOneKnowsAlongAndTheOtherAcrossComesTogether) {
  HazardEstimate estimate =
      FirstEstimate(ReportAt({1, 0}, Eigen::Vector2d(9.0, 0.25).asDiagonal()));
  Fuse(estimate, ReportAt({0, 1}, Eigen::Vector2d(0.25, 9.0).asDiagonal()), {});
  EXPECT_LT(PlaceOf(estimate).norm(), 0.1);
  EXPECT_LT(estimate.covariance_m2.trace(), 0.6);
  EXPECT_GT(estimate.covariance_m2.determinant(), 0);
}

TEST(HazardFusion, ErrorFallsWithTheVehiclesAndTheCovarianceStaysHonest) {
  // Receivers that share a tenth of their variance at the place.
  constexpr int kSeeds = 200;
  constexpr std::array<int, 5> kVehicles = {1, 2, 5, 10, 20};
  Eigen::Matrix2d covariance;
  covariance << 4.0, 1.0, 1.0, 2.0;
  const Eigen::Matrix2d root = covariance.llt().matrixL();
  std::array<double, kVehicles.size()> squares{};
  std::array<double, kVehicles.size()> nees{};
  for (int seed = 1; seed <= kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    std::normal_distribution<double> normal;
    const auto draw = [&](double share) {
      return Eigen::Vector2d(std::sqrt(share) * root *
                             Eigen::Vector2d(normal(random), normal(random)));
    };
    const Eigen::Vector2d common = draw(0.1);
    HazardEstimate estimate = FirstEstimate(ReportAt(common + draw(0.9), covariance));
    std::size_t step = 0;
    for (int n = 1; n <= kVehicles.back(); ++n) {
      if (n > 1) Fuse(estimate, ReportAt(common + draw(0.9), covariance), {});
      if (n != kVehicles.at(step)) continue;
      const Eigen::Vector2d error = PlaceOf(estimate);
      squares.at(step) += error.squaredNorm() / kSeeds;
      nees.at(step) += error.dot(estimate.covariance_m2.inverse() * error) / 2 / kSeeds;
      ++step;
    }
  }
  for (std::size_t i = 0; i < kVehicles.size(); ++i) {
    EXPECT_GT(nees.at(i), 0.8) << kVehicles.at(i);
    EXPECT_LT(nees.at(i), 1.25) << kVehicles.at(i);
    if (i == 0) continue;
    EXPECT_LT(squares.at(i), squares.at(i - 1)) << kVehicles.at(i);
  }
}

TEST(HazardFusion, OnlyAMuchSurerReportNearbyTakesThePlace) {
  const HazardEstimate estimate = FirstEstimate(ReportAt({0, 0}, Eigen::Matrix2d::Identity() * 4));
  const Eigen::Matrix2d sure = Eigen::Matrix2d::Identity() * 1.9;
  EXPECT_TRUE(IsSurer(estimate, ReportAt({3, 0}, sure), {}));
  EXPECT_FALSE(IsSurer(estimate, ReportAt({3, 0}, Eigen::Matrix2d::Identity() * 2.1), {}));
  EXPECT_FALSE(IsSurer(estimate, ReportAt({6.5, 0}, sure), {}));
  HazardEstimate taken = estimate;
  TakePlace(taken, ReportAt({3, 0}, sure), {});
  EXPECT_NEAR(PlaceOf(taken).x(), 3, 1e-6);
  EXPECT_EQ(taken.sightings, 2u);
  EXPECT_EQ(taken.covariance_m2, sure);
}

}  // namespace
}  // namespace livemap::zone
