#include "odometry/se3.h"

#include <gtest/gtest.h>

#include <random>
#include <unsupported/Eigen/MatrixFunctions>

namespace livemap::odometry {
namespace {

Vector6d RandomTwist(std::mt19937_64& random, double scale) {
  std::uniform_real_distribution<double> value(-scale, scale);
  Vector6d twist;
  for (int i = 0; i < 6; ++i) twist[i] = value(random);
  return twist;
}

Eigen::Matrix4d Generator(const Vector6d& twist) {
  Eigen::Matrix4d generator = Eigen::Matrix4d::Zero();
  generator.topLeftCorner<3, 3>() = CrossMatrix(twist.tail<3>());
  generator.topRightCorner<3, 1>() = twist.head<3>();
  return generator;
}

TEST(Se3, ExponentialIsTheMatrixExponential) {
  std::mt19937_64 random{1};
  for (const double scale : {1e-9, 1e-5, 1e-4, 0.01, 1.0}) {
    for (int i = 0; i < 20; ++i) {
      const Vector6d twist = RandomTwist(random, scale);
      const Eigen::Matrix4d expected = Generator(twist).exp();
      EXPECT_LT((Se3Exp(twist).matrix() - expected).norm(), 1e-13) << scale;
    }
  }
}

TEST(Se3, LogarithmUndoesTheExponential) {
  std::mt19937_64 random{2};
  for (const double scale : {1e-8, 1e-3, 0.5, 1.7}) {
    for (int i = 0; i < 20; ++i) {
      const Vector6d twist = RandomTwist(random, scale);
      EXPECT_LT((Se3Log(Se3Exp(twist)) - twist).norm(), 1e-9) << scale;
    }
  }
}

TEST(Se3, AdjointCarriesAPerturbationToTheOtherSide) {
  std::mt19937_64 random{3};
  const Eigen::Isometry3d pose = Se3Exp(RandomTwist(random, 1.0));
  const Vector6d twist = RandomTwist(random, 0.3);
  EXPECT_LT(
      ((pose * Se3Exp(twist)).matrix() - (Se3Exp(Se3Adjoint(pose) * twist) * pose).matrix()).norm(),
      1e-12);
}

TEST(Se3, RenormalisingMendsARotationThatIsNoLongerOne) {
  Eigen::Isometry3d pose = Se3Exp((Vector6d() << 1, 2, 3, 0.3, 0.2, 0.1).finished());
  pose.linear() *= 1.001;
  const Eigen::Matrix3d rotation = Renormalised(pose).linear();
  EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_EQ(Renormalised(pose).translation(), pose.translation());
}

}  // namespace
}  // namespace livemap::odometry
