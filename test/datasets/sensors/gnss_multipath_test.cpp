#include "datasets/sensors/gnss_multipath.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <vector>

#include "common/error.h"

namespace livemap::datasets {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr SkyVisibility kCanyon{M_PI / 4, M_PI / 4};
constexpr SkyVisibility kHousesLeft{M_PI / 4, 0};
constexpr SkyVisibility kPark{0, 0};

struct Errors {
  std::vector<double> east;
  std::vector<double> north;
};

/// Fixes every `step_m` metres and `step_s` seconds in a street that runs east.
Errors Drive(double sigma_m, const SkyVisibility& sky, int count, double step_m, double step_s) {
  GnssMultipath multipath(sigma_m, 5);
  Errors errors;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d error = multipath.ErrorAt(i * step_s, i * step_m, 0, sky);
    errors.east.push_back(error.x());
    errors.north.push_back(error.y());
  }
  return errors;
}

double Mean(const std::vector<double>& x) {
  double sum = 0;
  for (const double value : x) sum += value;
  return sum / static_cast<double>(x.size());
}

double Covariance(const std::vector<double>& x, std::size_t lag) {
  const double mean = Mean(x);
  double sum = 0;
  for (std::size_t i = 0; i + lag < x.size(); ++i) sum += (x[i] - mean) * (x[i + lag] - mean);
  return sum / static_cast<double>(x.size() - lag);
}

TEST(GnssMultipath, WallsToBothSidesHideTheirWedgesOfTheSky) {
  EXPECT_DOUBLE_EQ(kPark.HiddenShare(), 0);
  EXPECT_DOUBLE_EQ(kHousesLeft.HiddenShare(), 0.25);
  EXPECT_DOUBLE_EQ(kCanyon.HiddenShare(), 0.5);
  EXPECT_DOUBLE_EQ((SkyVisibility{M_PI / 2, M_PI / 2}).HiddenShare(), 1);
  EXPECT_DOUBLE_EQ(kHousesLeft.LeftSurplus(), 0.25);
  EXPECT_DOUBLE_EQ((SkyVisibility{0, M_PI / 4}).LeftSurplus(), -0.25);
}

TEST(GnssMultipath, CanyonHasTheStatedSigmasAndNoPush) {
  // 10 m apart: 400000 m are about 6700 independent values, the variance is known to 1.7 %.
  const Errors errors = Drive(3, kCanyon, 40000, 10, 0);
  EXPECT_NEAR(Mean(errors.north), 0, 0.2);
  EXPECT_NEAR(Covariance(errors.north, 0) / 9, 1, 0.09);
  EXPECT_NEAR(Covariance(errors.east, 0) / 2.25, 1, 0.09);
}

TEST(GnssMultipath, HousesToTheLeftPushToTheRight) {
  const Errors errors = Drive(4, kHousesLeft, 40000, 10, 0);
  EXPECT_NEAR(Mean(errors.north), -2, 0.15);
  EXPECT_NEAR(Mean(errors.east), 0, 0.1);
  EXPECT_NEAR(std::sqrt(Covariance(errors.north, 0)), 2, 0.1);
}

TEST(GnssMultipath, ForgetsWithinThirtyMetresOrAHundredSeconds) {
  const Errors moving = Drive(1, kCanyon, 40000, 10, 0);
  EXPECT_NEAR(Covariance(moving.north, 3) / Covariance(moving.north, 0), std::exp(-1), 0.06);
  const Errors standing = Drive(1, kCanyon, 40000, 0, 20);
  EXPECT_NEAR(Covariance(standing.east, 5) / Covariance(standing.east, 0), std::exp(-1), 0.06);
}

TEST(GnssMultipath, TurnsWithTheStreet) {
  GnssMultipath east(2, 5);
  GnssMultipath north(2, 5);
  const Eigen::Vector2d a = east.ErrorAt(0, 0, 0, kHousesLeft);
  const Eigen::Vector2d b = north.ErrorAt(0, 0, M_PI / 2, kHousesLeft);
  EXPECT_NEAR(b.x(), -a.y(), 1e-12);
  EXPECT_NEAR(b.y(), a.x(), 1e-12);
}

TEST(GnssMultipath, NeitherAParkNorZeroMetresMoveAFix) {
  for (const Errors& errors : {Drive(0, kCanyon, 100, 1, 0.1), Drive(5, kPark, 100, 1, 0.1)}) {
    for (const double error : errors.east) ASSERT_EQ(error, 0);
    for (const double error : errors.north) ASSERT_EQ(error, 0);
  }
}

TEST(GnssMultipath, SameSeedSameErrors) {
  EXPECT_EQ(Drive(2, kCanyon, 50, 1, 0.1).north, Drive(2, kCanyon, 50, 1, 0.1).north);
  EXPECT_NE(GnssMultipath(2, 6).ErrorAt(0, 0, 0, kCanyon),
            GnssMultipath(2, 5).ErrorAt(0, 0, 0, kCanyon));
}

TEST(GnssMultipath, RefusesImpossibleSizes) {
  for (const double sigma_m : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THAT([&] { GnssMultipath(sigma_m, 1); }, ThrowsMessage<Error>(HasSubstr("multipath")));
  }
}

}  // namespace
}  // namespace livemap::datasets
