#include "geo/fix_plausibility.h"

#include <gtest/gtest.h>

#include <limits>

namespace livemap::geo {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

Fix FixOf(const GeoPoint& position) { return {1'700'000'000'000'000'000, true, position, {}}; }

Fix WithVariances(double east_m2, double north_m2) {
  Fix fix = FixOf({48, 11});
  fix.covariance_m2 = Eigen::Vector2d(east_m2, north_m2).asDiagonal();
  return fix;
}

TEST(FixPlausibility, NullIslandIsNoFix) {
  EXPECT_FALSE(IsPlausible(FixOf({0, 0})));
  EXPECT_FALSE(IsPlausible(FixOf({1e-7, -1e-7})));
  EXPECT_TRUE(IsPlausible(FixOf({0, 32.4}))) << "the equator has roads";
  EXPECT_TRUE(IsPlausible(FixOf({51.5, 0}))) << "and so has the meridian of Greenwich";
}

TEST(FixPlausibility, ACovarianceThatCannotBeIsNoFix) {
  EXPECT_TRUE(IsPlausible(WithVariances(4, 9)));
  EXPECT_TRUE(IsPlausible(WithVariances(0, 0)));
  EXPECT_FALSE(IsPlausible(WithVariances(kInf, 1)));
  EXPECT_FALSE(IsPlausible(WithVariances(-1, 1)));
  EXPECT_FALSE(IsPlausible(WithVariances(1e9, 1e9)));
}

TEST(FixPlausibility, ACovarianceOfNothingIsNotStated) {
  EXPECT_EQ(CovarianceOf(WithVariances(0, 0), 3), Eigen::Matrix2d(9 * Eigen::Matrix2d::Identity()));
  EXPECT_EQ(CovarianceOf(WithVariances(4, 0), 3), Eigen::Matrix2d(9 * Eigen::Matrix2d::Identity()));
  EXPECT_EQ(CovarianceOf(FixOf({48, 11}), 3), Eigen::Matrix2d(9 * Eigen::Matrix2d::Identity()));
  EXPECT_EQ(CovarianceOf(WithVariances(4, 1), 3)(0, 0), 4);
}

TEST(FixPlausibility, ReachIsSpeedTimesTimeAndUncertaintyInEitherOrder) {
  const ReceiverPoint here{1'000'000'000, {48, 11}, 1};
  const ReceiverPoint later{2'000'000'000, GeodesicDestination({48, 11}, 1, 80), 1};
  EXPECT_TRUE(AreReachable(here, later, 80));
  EXPECT_TRUE(AreReachable(later, here, 80));
  EXPECT_FALSE(AreReachable(here, later, 70));
}

}  // namespace
}  // namespace livemap::geo
