#include "geo/ground_projection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace livemap::geo {
namespace {

constexpr CameraIntrinsics kCamera{500, 520, 320, 240, 640, 480};
constexpr double kHeightM = 1.4;
constexpr double kForwardM = 1.5;

/// A camera at (kForwardM, 0, height) that looks forward and `pitch_down_rad` down.
Eigen::Isometry3d Mount(double pitch_down_rad, double height_m = kHeightM) {
  Eigen::Matrix3d base_from_level_optical;
  base_from_level_optical << 0, 0, 1,  //
      -1, 0, 0,                        //
      0, -1, 0;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  // A positive rotation about y, which points left, turns the view downwards.
  pose.linear() = Eigen::AngleAxisd(pitch_down_rad, Eigen::Vector3d::UnitY()).toRotationMatrix() *
                  base_from_level_optical;
  pose.translation() = Eigen::Vector3d(kForwardM, 0, height_m);
  return pose;
}

TEST(ProjectToGround, FindsThePointWhoseImageThePixelIs) {
  const Eigen::Isometry3d pose = Mount(0.1);
  const GroundProjectionNoise noise;
  for (const Eigen::Vector2d& expected :
       {Eigen::Vector2d(8, 0), Eigen::Vector2d(20, 3), Eigen::Vector2d(50, -6)}) {
    const Eigen::Vector3d in_camera =
        pose.inverse() * Eigen::Vector3d(expected.x(), expected.y(), 0);
    const Eigen::Vector2d pixel(kCamera.fx * in_camera.x() / in_camera.z() + kCamera.cx,
                                kCamera.fy * in_camera.y() / in_camera.z() + kCamera.cy);
    const auto point = ProjectToGround(pixel, kCamera, pose, noise);
    ASSERT_TRUE(point);
    EXPECT_LT((point->position_m - expected).norm(), 1e-9);
  }
}

TEST(ProjectToGround, GivesNothingAtOrAboveTheHorizonOrTooFar) {
  const GroundProjectionNoise noise;
  const Eigen::Isometry3d level = Mount(0);
  EXPECT_FALSE(ProjectToGround({320, 240}, kCamera, level, noise));
  EXPECT_FALSE(ProjectToGround({320, 100}, kCamera, level, noise));
  // 1.4 m * 520 px / 60 m = 12.13 px below the horizon is the limit.
  EXPECT_FALSE(ProjectToGround({320, 240 + 12.0}, kCamera, level, noise));
  EXPECT_TRUE(ProjectToGround({320, 240 + 12.3}, kCamera, level, noise));
}

TEST(ProjectToGround, GivesNothingForACameraUnderTheRoadOrBrokenInput) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const GroundProjectionNoise noise;
  EXPECT_FALSE(ProjectToGround({320, 400}, kCamera, Mount(0, 0.0), noise));
  EXPECT_FALSE(ProjectToGround({320, 100}, kCamera, Mount(0, -1.0), noise));
  EXPECT_FALSE(ProjectToGround({kNan, 400}, kCamera, Mount(0), noise));
  EXPECT_FALSE(ProjectToGround({320, 400}, kCamera, Mount(kNan), noise));
  CameraIntrinsics no_focal_length = kCamera;
  no_focal_length.fx = 0;
  EXPECT_FALSE(ProjectToGround({320, 400}, no_focal_length, Mount(0), noise));
}

TEST(ProjectToGround, CovarianceEqualsNumericDifferentiation) {
  const GroundProjectionNoise noise{2.0, 0.005, 0.04, 100.0};
  const Eigen::Vector2d pixel(400, 300);
  constexpr double kStep = 1e-6;
  const auto at = [&](double u, double v, double pitch, double height) {
    return ProjectToGround(pixel + Eigen::Vector2d(u, v), kCamera,
                           Mount(0.07 + pitch, kHeightM + height), noise)
        ->position_m;
  };
  Eigen::Matrix<double, 2, 4> weighted;
  weighted.col(0) = (at(kStep, 0, 0, 0) - at(-kStep, 0, 0, 0)) * noise.pixel_sigma_px;
  weighted.col(1) = (at(0, kStep, 0, 0) - at(0, -kStep, 0, 0)) * noise.pixel_sigma_px;
  weighted.col(2) = (at(0, 0, kStep, 0) - at(0, 0, -kStep, 0)) * noise.pitch_sigma_rad;
  weighted.col(3) = (at(0, 0, 0, kStep) - at(0, 0, 0, -kStep)) * noise.height_sigma_m;
  weighted /= 2 * kStep;
  const Eigen::Matrix2d expected = weighted * weighted.transpose();
  const auto point = ProjectToGround(pixel, kCamera, Mount(0.07), noise);
  ASSERT_TRUE(point);
  EXPECT_LT((point->covariance_m2 - expected).norm(), 1e-6 * expected.norm());
}

TEST(SensitivityOfGroundPoint, IsTheDerivativeOfTheProjection) {
  const GroundProjectionNoise noise;
  const Eigen::Isometry3d pose = Mount(0.1);
  const Eigen::Vector2d place(14, -2);
  const auto moves = SensitivityOfGroundPoint(place, kCamera, pose);
  ASSERT_TRUE(moves);
  const auto point = [&](const Eigen::Vector2d& pixel, const Eigen::Isometry3d& mounting) {
    return ProjectToGround(pixel, kCamera, mounting, noise)->position_m;
  };
  EXPECT_LT((point(moves->pixel, pose) - place).norm(), 1e-9);
  constexpr double kStep = 1e-5;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(axis);
    const Eigen::Vector2d slope =
        (point(moves->pixel + step, pose) - point(moves->pixel - step, pose)) / (2 * kStep);
    EXPECT_LT((slope - moves->per_pixel.col(axis)).norm(), 1e-5);
  }
  const Eigen::Vector2d by_pitch =
      (point(moves->pixel, Mount(0.1 + kStep)) - point(moves->pixel, Mount(0.1 - kStep))) /
      (2 * kStep);
  EXPECT_LT((by_pitch - moves->per_pitch).norm(), 1e-3);
  const Eigen::Vector2d by_height = (point(moves->pixel, Mount(0.1, kHeightM + kStep)) -
                                     point(moves->pixel, Mount(0.1, kHeightM - kStep))) /
                                    (2 * kStep);
  EXPECT_LT((by_height - moves->per_height).norm(), 1e-5);
}

TEST(SensitivityOfGroundPoint, IsNoneWhereTheCameraSeesNoSuchPoint) {
  EXPECT_FALSE(SensitivityOfGroundPoint({-3, 0}, kCamera, Mount(0)));
  EXPECT_FALSE(SensitivityOfGroundPoint({10, 0}, kCamera, Mount(0, -1)));
  EXPECT_FALSE(
      SensitivityOfGroundPoint({std::numeric_limits<double>::quiet_NaN(), 0}, kCamera, Mount(0)));
}

TEST(ProjectToGround, CovarianceEqualsTheSpreadOfNoisyProjections) {
  const GroundProjectionNoise noise{1.0, 0.002, 0.02, 100.0};
  const Eigen::Vector2d pixel(350, 330);
  std::mt19937_64 generator(11);
  std::normal_distribution<double> normal;
  constexpr int kSamples = 20000;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  for (int i = 0; i < kSamples; ++i) {
    const Eigen::Vector2d noisy =
        pixel + noise.pixel_sigma_px * Eigen::Vector2d(normal(generator), normal(generator));
    const double pitch = 0.05 + noise.pitch_sigma_rad * normal(generator);
    const double height = kHeightM + noise.height_sigma_m * normal(generator);
    const auto sample = ProjectToGround(noisy, kCamera, Mount(pitch, height), noise);
    ASSERT_TRUE(sample);
    sum += sample->position_m;
    squares += sample->position_m * sample->position_m.transpose();
  }
  const Eigen::Vector2d mean = sum / kSamples;
  const Eigen::Matrix2d spread = squares / kSamples - mean * mean.transpose();
  const auto point = ProjectToGround(pixel, kCamera, Mount(0.05), noise);
  ASSERT_TRUE(point);
  EXPECT_LT((point->covariance_m2 - spread).norm(), 0.05 * spread.norm());
}

}  // namespace
}  // namespace livemap::geo
