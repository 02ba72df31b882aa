#include "geo/fix_covariance.h"

#include <gtest/gtest.h>

#include <limits>

namespace livemap::geo {
namespace {

Eigen::Matrix2d Matrix(double east, double cross, double north) {
  return (Eigen::Matrix2d() << east, cross, cross, north).finished();
}

TEST(FixCovariance, UsualOnesAndACertainPositionAreTaken) {
  EXPECT_TRUE(IsFixCovariance(Matrix(4, 1, 9)));
  EXPECT_TRUE(IsFixCovariance(Matrix(0, 0, 0)));
  EXPECT_TRUE(IsFixCovariance(Matrix(4, 6, 9))) << "a line is the thinnest ellipse";
}

TEST(FixCovariance, WhatIsNoCovarianceIsRefused) {
  EXPECT_FALSE(IsFixCovariance(Matrix(-1, 0, 9)));
  EXPECT_FALSE(IsFixCovariance(Matrix(4, 7, 9))) << "correlation above one";
  EXPECT_FALSE(IsFixCovariance(Matrix(std::numeric_limits<double>::quiet_NaN(), 0, 9)));
  EXPECT_FALSE(IsFixCovariance(Matrix(4, std::numeric_limits<double>::infinity(), 9)));
  EXPECT_FALSE(IsFixCovariance((Eigen::Matrix2d() << 4, 1, -1, 9).finished())) << "not symmetric";
}

TEST(FixCovariance, WhatSaysNothingOfThePositionIsRefused) {
  const double most = kMaxFixSigmaM * kMaxFixSigmaM;
  EXPECT_TRUE(IsFixCovariance(Matrix(most, 0, most)));
  EXPECT_FALSE(IsFixCovariance(Matrix(1.01 * most, 0, 1.01 * most)));
}

}  // namespace
}  // namespace livemap::geo
