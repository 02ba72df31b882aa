#include "odometry/edge/seen_movements.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace livemap::odometry {
namespace {

Matrix6d Diagonal(double x, double y, double z, double roll, double pitch, double yaw) {
  return Vector6d((Vector6d() << x, y, z, roll, pitch, yaw).finished()).asDiagonal();
}

TEST(SeenMovements, WithoutNoiseEverythingIsSeenAndTheCovarianceStays) {
  const SeenMovements seen(Diagonal(1, 2, 3, 4, 5, 6), Matrix6d::Zero());
  const Vector6d step = (Vector6d() << 1, -2, 3, -4, 5, -6).finished();
  EXPECT_TRUE(seen.All());
  EXPECT_TRUE(seen.Told(step).isApprox(step));
  const Matrix6d covariance = Diagonal(6, 5, 4, 3, 2, 1);
  EXPECT_TRUE(seen.Widened(covariance).isApprox(covariance));
}

TEST(SeenMovements, WhatIsMostlyNoiseIsNotMovedAndHasTheVarianceOfTheUnseen) {
  const SeenMovements seen(Diagonal(100, 10, 100, 100, 100, 100), Diagonal(1, 8, 1, 1, 1, 1));
  EXPECT_FALSE(seen.All());
  const Vector6d told = seen.Told(Vector6d::Ones());
  EXPECT_NEAR(told[0], 1, 1e-12);
  EXPECT_NEAR(told[1], 0, 1e-12);
  const Matrix6d widened = seen.Widened(0.01 * Matrix6d::Identity());
  EXPECT_NEAR(widened(1, 1), 100, 1e-9);
  EXPECT_NEAR(widened(0, 0), 0.01, 1e-9);
}

TEST(SeenMovements, AnUnseenMovementMayLieAcrossTheAxes) {
  // Of right and down only their difference is told.
  Matrix6d information = Diagonal(100, 100, 100, 100, 100, 100);
  information(0, 1) = information(1, 0) = -99;
  const SeenMovements seen(information, Diagonal(0.9, 0.9, 0, 0, 0, 0));
  const Vector6d told = seen.Told((Vector6d() << 1, 0, 0, 0, 0, 0).finished());
  EXPECT_NEAR(told[0], 0.5, 0.01);
  EXPECT_NEAR(told[1], -0.5, 0.01);
}

TEST(SeenMovements, TwoUnseenMovementsThatAreAllButParallelAreBothUnseen) {
  // Down and a turn up bring the points of a wall to nearly the same places.
  Matrix6d information = Diagonal(100, 1, 100, 1, 100, 100);
  information(1, 3) = information(3, 1) = 0.9999;
  const SeenMovements seen(information, information - Diagonal(99, 0, 99, 0, 99, 99));
  const Matrix6d widened = seen.Widened(1e-4 * Matrix6d::Identity());
  EXPECT_NEAR(widened(1, 1), kUnseenVariance, 1e-2);
  EXPECT_NEAR(widened(3, 3), kUnseenVariance, 1e-2);
  EXPECT_NEAR(widened(0, 0), 1e-4, 1e-9);
}

TEST(SeenMovements, InformationThatTellsNothingChangesNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Matrix6d& information :
       {Matrix6d(Matrix6d::Zero()), Matrix6d(Matrix6d::Constant(nan))}) {
    const SeenMovements seen(information, Matrix6d::Identity());
    EXPECT_TRUE(seen.All());
    EXPECT_TRUE(seen.Widened(Matrix6d::Identity()).isIdentity());
  }
}

TEST(UnseenPart, WhatIsSeenHasNone) {
  EXPECT_TRUE(UnseenPart(Vector6d::Ones(), 1e-4 * Matrix6d::Identity()).isZero());
}

TEST(UnseenPart, IsThePartAlongAnUnseenMovement) {
  const Vector6d difference = (Vector6d() << 1, -2, 3, 4, 5, 6).finished();
  const Vector6d part =
      UnseenPart(difference, Diagonal(1e-6, kUnseenVariance, 1e-6, 1e-6, 1e-6, 1e-6));
  EXPECT_TRUE(part.isApprox(Vector6d(-2 * Vector6d::Unit(1)))) << part.transpose();
}

TEST(UnseenPart, OfAMovementAcrossTheAxesTakesTheNearest) {
  const Vector6d direction = (Vector6d::Unit(0) + Vector6d::Unit(1)) / std::sqrt(2.0);
  const Matrix6d covariance =
      1e-6 * Matrix6d::Identity() + kUnseenVariance * direction * direction.transpose();
  const Vector6d part = UnseenPart(Vector6d::Unit(0), covariance);
  EXPECT_TRUE(part.isApprox(Vector6d(0.5 * (Vector6d::Unit(0) + Vector6d::Unit(1)))))
      << part.transpose();
}

TEST(UnseenPart, OfACovarianceThatIsNoneIsNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(UnseenPart(Vector6d::Ones(), Matrix6d::Constant(nan)).isZero());
}

}  // namespace
}  // namespace livemap::odometry
