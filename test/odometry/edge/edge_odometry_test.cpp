#include "odometry/edge/edge_odometry.h"

#include <gmock/gmock.h>

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "common/error.h"
#include "test/odometry/synthetic_scene.h"

namespace livemap::odometry {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr std::int64_t kStepNs = 33'333'333;

std::int64_t Stamp(int frame) { return 1'000'000'000 + frame * kStepNs; }

/// A hand that sways before the wall; the first pose is the identity.
Eigen::Isometry3d Sway(int frame) {
  const double t = frame * 0.033;
  return Pose(0.12 * std::sin(1.1 * t), 0.08 * std::sin(1.7 * t), 0.1 * std::sin(0.7 * t),
              0.04 * std::sin(1.3 * t), 0.05 * std::sin(0.9 * t), 0.08 * std::sin(t));
}

double ErrorM(const VoResult& result, int frame) {
  return (result.world_from_camera.translation() - Sway(frame).translation()).norm();
}

class EdgeOdometryOf : public ::testing::TestWithParam<EdgeSource> {};

TEST_P(EdgeOdometryOf, FollowsASwayingHandWithinMillimetres) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry::Config config;
  config.edge_source = GetParam();
  EdgeOdometry odometry(config, kWallCamera);
  for (int i = 0; i < 90; ++i) {
    const VoResult result = odometry.Track(wall.See(Stamp(i), Sway(i)));
    ASSERT_EQ(result.state, VoState::kTracking) << i;
    ASSERT_LT(ErrorM(result, i), 0.004) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(EdgesOf, EdgeOdometryOf,
                         ::testing::Values(EdgeSource::kKeyframe, EdgeSource::kNewImage));

TEST(EdgeOdometry, FollowsByRandomPixelsAndWithoutConstantMotion) {
  const SyntheticWall wall(kWallCamera);
  for (const PixelChoice choice : {PixelChoice::kRandomEdges, PixelChoice::kRandomPixels}) {
    EdgeOdometry::Config config;
    config.points.choice = choice;
    config.points.share = 0.5;
    config.constant_motion = false;
    EdgeOdometry odometry(config, kWallCamera);
    for (int i = 0; i < 30; ++i) {
      const VoResult result = odometry.Track(wall.See(Stamp(i), Sway(i)));
      ASSERT_EQ(result.state, VoState::kTracking) << i;
      ASSERT_LT(ErrorM(result, i), 0.01) << i;
    }
  }
}

TEST(EdgeOdometry, AnotherSeedDrawsOtherPixels) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry::Config config;
  config.points.choice = PixelChoice::kRandomEdges;
  config.points.share = 0.2;
  const auto last = [&](std::uint32_t seed) {
    config.points.seed = seed;
    EdgeOdometry odometry(config, kWallCamera);
    odometry.Track(wall.See(Stamp(0), Sway(0)));
    return odometry.Track(wall.See(Stamp(1), Sway(1))).world_from_camera.matrix();
  };
  EXPECT_EQ(last(1), last(1));
  EXPECT_NE(last(1), last(2));
}

TEST(EdgeOdometry, SixteenBitAndFloatDepthAgree) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry with_float({}, kWallCamera), with_units({}, kWallCamera);
  for (int i = 0; i < 10; ++i) {
    RgbdFrame frame = wall.See(Stamp(i), Sway(i));
    const VoResult expected = with_float.Track(frame);
    frame.depth.convertTo(frame.depth, CV_16U, 5000);
    frame.depth_units_per_m = 5000;
    const VoResult result = with_units.Track(frame);
    EXPECT_LT(
        (result.world_from_camera.translation() - expected.world_from_camera.translation()).norm(),
        2e-4);
  }
}

TEST(EdgeOdometry, TheSameFramesGiveTheSameBits) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry first({}, kWallCamera), second({}, kWallCamera);
  for (int i = 0; i < 20; ++i) {
    const RgbdFrame frame = wall.See(Stamp(i), Sway(i));
    EXPECT_EQ(first.Track(frame).world_from_camera.matrix(),
              second.Track(frame).world_from_camera.matrix())
        << i;
  }
}

TEST(EdgeOdometry, FlickeringLightDoesNotBreakTracking) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry odometry({}, kWallCamera);
  for (int i = 0; i < 60; ++i) {
    const double gain = 1 + 0.3 * std::sin(0.6 * i), bias = 15 * std::cos(0.4 * i);
    const VoResult result = odometry.Track(wall.See(Stamp(i), Sway(i), gain, bias));
    ASSERT_EQ(result.state, VoState::kTracking) << i;
    ASSERT_LT(ErrorM(result, i), 0.006) << i;
  }
}

TEST(EdgeOdometry, AFastCameraKeepsItsKeyframeForSomeSteps) {
  const SyntheticWall wall(kWallCamera);
  // 7 px a step, at 2 m: more than keyframe_motion.
  const auto pose = [](int i) { return Pose(0.05 * i, 0, 0, 0, 0, 0); };
  const auto count_keyframes = [&](double keyframe_steps) {
    EdgeOdometry::Config config;
    config.keyframe_steps = keyframe_steps;
    EdgeOdometry odometry(config, kWallCamera);
    int keyframes = 0;
    VoResult result;
    for (int i = 0; i < 13; ++i) {
      result = odometry.Track(wall.See(Stamp(i), pose(i)));
      EXPECT_EQ(result.state, VoState::kTracking) << i;
      keyframes += result.new_keyframe ? 1 : 0;
    }
    EXPECT_LT((result.world_from_camera.translation() - pose(12).translation()).norm(), 0.006);
    return keyframes;
  };
  EXPECT_EQ(count_keyframes(0), 12);
  EXPECT_LE(count_keyframes(2.5), 6);
}

TEST(EdgeOdometry, ACameraOfMediumSpeedKeepsItsKeyframeForSomeStepsToo) {
  const SyntheticWall wall(kWallCamera);
  // 4 px a step, at 2 m: less than keyframe_motion, and more than half of it.
  const auto pose = [](int i) { return Pose(0.03 * i, 0, 0, 0, 0, 0); };
  EdgeOdometry odometry({}, kWallCamera);
  int keyframes = 0;
  for (int i = 0; i < 17; ++i) {
    const VoResult result = odometry.Track(wall.See(Stamp(i), pose(i)));
    ASSERT_EQ(result.state, VoState::kTracking) << i;
    keyframes += result.new_keyframe ? 1 : 0;
  }
  EXPECT_LE(keyframes, 5) << "each adds its error to the path";
}

TEST(EdgeOdometry, ASoftPictureIsFollowedOnACoarseLevel) {
  cv::Mat spots(15, 21, CV_8UC1), picture;
  cv::RNG(4).fill(spots, cv::RNG::UNIFORM, 120, 137);
  cv::resize(spots, picture, {672, 480}, 0, 0, cv::INTER_CUBIC);
  EdgeOdometry odometry({}, {520, 520, 319.5, 239.5, 640, 480});
  VoResult result;
  for (int i = 0; i < 4; ++i) {
    RgbdFrame frame;
    frame.stamp_ns = Stamp(i);
    frame.grey = picture(cv::Rect(5 * i, 0, 640, 480)).clone();
    frame.depth = cv::Mat(480, 640, CV_32FC1, cv::Scalar(2));
    result = odometry.Track(frame);
    ASSERT_EQ(result.state, VoState::kTracking) << i;
  }
  EXPECT_GT(odometry.keyframe()->finest_level, 0);
  EXPECT_NEAR(result.world_from_camera.translation().x(), 15 * 2 / 520.0, 0.01);
}

TEST(EdgeOdometry, LessAgreementStartsNoSearchWhileTheMotionGoesOn) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry odometry({}, kWallCamera);
  VoResult result;
  for (int i = 0; i < 8; ++i) {
    RgbdFrame frame = wall.See(Stamp(i), Pose(0.01 * i, 0, 0, 0, 0, 0));
    if (i == 7) {
      // One cell in sixteen shows something else.
      for (int v = 0; v < frame.grey.rows; v += 40) {
        for (int u = 0; u < frame.grey.cols; u += 40) {
          frame.grey(cv::Rect(u, v, 10, 10)).setTo(10);
        }
      }
    }
    const double before = result.agreement;
    result = odometry.Track(frame);
    if (i == 7) {
      EXPECT_LT(result.agreement, before - 0.04);
    }
  }
  EXPECT_EQ(result.state, VoState::kTracking);
  EXPECT_LT(result.iterations, 50);
}

TEST(EdgeOdometry, TwistIsTheVelocityInTheCamera) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry odometry({}, kWallCamera);
  VoResult result;
  for (int i = 0; i < 5; ++i) {
    result = odometry.Track(wall.See(Stamp(i), Pose(0.003 * i, 0, 0, 0, 0, 0)));
  }
  ASSERT_TRUE(result.twist);
  EXPECT_NEAR((*result.twist)[0], 0.003 / (kStepNs * 1e-9), 0.01);
  EXPECT_NEAR(result.twist->tail<5>().norm(), 0, 0.02);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> axes(result.twist_covariance);
  EXPECT_GT(axes.eigenvalues().minCoeff(), 0) << "no direction is known without error";
  EXPECT_LT(std::sqrt(result.twist_covariance(0, 0)), 0.1) << "m/s";
}

TEST(EdgeOdometry, BlackFramesHoldThePoseWithGrowingUncertaintyAndTrackingComesBack) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry odometry({}, kWallCamera);
  VoResult held;
  int frame = 0;
  for (; frame < 20; ++frame) held = odometry.Track(wall.See(Stamp(frame), Sway(frame)));
  double variance = held.covariance.trace();
  for (; frame < 40; ++frame) {
    RgbdFrame black = wall.See(Stamp(frame), Sway(frame));
    black.grey.setTo(0);
    const VoResult result = odometry.Track(black);
    EXPECT_EQ(result.state, VoState::kLost) << frame;
    EXPECT_EQ(result.world_from_camera.matrix(), held.world_from_camera.matrix()) << frame;
    EXPECT_FALSE(result.twist);
    EXPECT_GT(result.covariance.trace(), variance);
    variance = result.covariance.trace();
  }
  for (; frame < 60; ++frame) {
    const VoResult result = odometry.Track(wall.See(Stamp(frame), Sway(frame)));
    ASSERT_EQ(result.state, VoState::kTracking) << frame;
    ASSERT_LT(ErrorM(result, frame), 0.006) << frame;
    EXPECT_LT(result.covariance.trace(), variance);
  }
}

TEST(EdgeOdometry, LostForLongItGoesOnFromTheHeldPose) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry::Config config;
  config.give_up_s = 0.5;
  EdgeOdometry odometry(config, kWallCamera);
  VoResult held;
  int frame = 0;
  for (; frame < 10; ++frame) held = odometry.Track(wall.See(Stamp(frame), Sway(frame)));
  for (; frame < 30; ++frame) {
    RgbdFrame black = wall.See(Stamp(frame), Sway(frame));
    black.grey.setTo(0);
    odometry.Track(black);
  }
  // Another part of the wall, which no keyframe shows.
  const Eigen::Isometry3d elsewhere = Pose(1.9, 1.3, -0.4, 0.2, 0.1, 1.1);
  VoResult result;
  for (int i = 0; i < 5; ++i, ++frame) result = odometry.Track(wall.See(Stamp(frame), elsewhere));
  EXPECT_EQ(result.state, VoState::kTracking);
  EXPECT_LT((result.world_from_camera.translation() - held.world_from_camera.translation()).norm(),
            0.01)
      << "not at the origin, not anywhere else";
  EXPECT_GT(result.covariance(0, 0), 0.1) << "it does not know how far it went meanwhile";
}

TEST(EdgeOdometry, AFrameWithoutDepthIsTrackedButBecomesNoKeyframe) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry::Config config;
  config.keyframe_every = 1;
  EdgeOdometry odometry(config, kWallCamera);
  odometry.Track(wall.See(Stamp(0), Sway(0)));
  for (int i = 1; i < 5; ++i) {
    RgbdFrame frame = wall.See(Stamp(i), Sway(i));
    frame.depth.release();
    const VoResult result = odometry.Track(frame);
    EXPECT_EQ(result.state, VoState::kTracking);
    EXPECT_FALSE(result.new_keyframe);
    EXPECT_LT(ErrorM(result, i), 0.004);
  }
}

TEST(EdgeOdometry, ResetMakesTheNextFrameTheOrigin) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry odometry({}, kWallCamera);
  for (int i = 0; i < 30; ++i) odometry.Track(wall.See(Stamp(i), Sway(i)));
  odometry.Reset();
  const VoResult result = odometry.Track(wall.See(Stamp(3), Sway(30)));
  EXPECT_EQ(result.state, VoState::kTracking);
  EXPECT_TRUE(result.world_from_camera.isApprox(Eigen::Isometry3d::Identity()));
}

TEST(EdgeOdometry, NothingToSeeAtTheStartIsWaitedFor) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry odometry({}, kWallCamera);
  RgbdFrame empty = wall.See(Stamp(0), Sway(0));
  empty.grey.setTo(90);
  EXPECT_EQ(odometry.Track(empty).state, VoState::kInitialising);
  RgbdFrame blind = wall.See(Stamp(1), Sway(0));
  blind.depth.setTo(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(odometry.Track(blind).state, VoState::kInitialising);
  EXPECT_EQ(odometry.Track(wall.See(Stamp(2), Sway(0))).state, VoState::kTracking);
}

TEST(EdgeOdometry, WhatCannotBeAFrameIsRefusedInASentenceAndChangesNothing) {
  const SyntheticWall wall(kWallCamera);
  EdgeOdometry odometry({}, kWallCamera);
  odometry.Track(wall.See(Stamp(0), Sway(0)));
  RgbdFrame small = wall.See(Stamp(1), Sway(1));
  small.grey = cv::Mat(1, 1, CV_8UC1, cv::Scalar(0));
  EXPECT_THAT([&] { odometry.Track(small); }, ThrowsMessage<Error>(HasSubstr("1x1")));
  RgbdFrame colour = wall.See(Stamp(1), Sway(1));
  colour.grey = cv::Mat(240, 320, CV_8UC3);
  EXPECT_THAT([&] { odometry.Track(colour); }, ThrowsMessage<Error>(HasSubstr("8-bit grey")));
  RgbdFrame other = wall.See(Stamp(1), Sway(1));
  other.depth = cv::Mat(120, 160, CV_16UC1);
  EXPECT_THAT([&] { odometry.Track(other); }, ThrowsMessage<Error>(HasSubstr("160x120")));
  RgbdFrame strange = wall.See(Stamp(1), Sway(1));
  strange.depth = cv::Mat(240, 320, CV_64FC1);
  EXPECT_THAT([&] { odometry.Track(strange); }, ThrowsMessage<Error>(HasSubstr("16UC1")));
  EXPECT_THAT([&] { odometry.Track(wall.See(Stamp(0), Sway(1))); },
              ThrowsMessage<Error>(HasSubstr("not later")));
  EXPECT_EQ(odometry.Track(wall.See(Stamp(1), Sway(1))).state, VoState::kTracking);
}

TEST(EdgeOdometry, ACameraWithoutCalibrationIsRefusedInASentence) {
  const auto make = [](geo::CameraIntrinsics camera) {
    return [camera] { EdgeOdometry({}, camera); };
  };
  EXPECT_THAT(make({0, 0, 0, 0, 320, 240}), ThrowsMessage<Error>(HasSubstr("calibration")));
  EXPECT_THAT(make({std::nan(""), 260, 160, 120, 320, 240}),
              ThrowsMessage<Error>(HasSubstr("calibration")));
  EXPECT_THAT(make({260, 260, 160, 120, 1, 1}), ThrowsMessage<Error>(HasSubstr("1x1")));
}

TEST(EdgeOdometry, StraightEdgesAllOneWayDoNotFixThePose) {
  RgbdFrame stripes;
  stripes.grey.create(240, 320, CV_8UC1);
  for (int x = 0; x < 320; ++x) stripes.grey.col(x).setTo(x / 16 % 2 == 0 ? 60 : 190);
  stripes.depth = cv::Mat(240, 320, CV_32FC1, cv::Scalar(2));
  EdgeOdometry odometry({}, kWallCamera);
  for (int i = 0; i < 5; ++i) {
    stripes.stamp_ns = Stamp(i);
    const VoResult result = odometry.Track(stripes);
    EXPECT_TRUE(result.covariance.allFinite());
    EXPECT_LT(result.world_from_camera.translation().norm(), 1e-3);
  }
}

/// A wall 2 m away, one ray per pixel, seen from so far to the right and so far down; `is_light`
/// says of a place on it, in metres, which of two grey values it has.
template <typename IsLight>
RgbdFrame SeeWall(int frame, double right_m, double down_m, cv::RNG& random, IsLight is_light) {
  RgbdFrame wall;
  wall.stamp_ns = Stamp(frame);
  wall.depth = cv::Mat(480, 640, CV_32FC1, cv::Scalar(2));
  wall.grey.create(480, 640, CV_8UC1);
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      const double x = right_m + 2 * (u - 319.5) / 525, y = down_m + 2 * (v - 239.5) / 525;
      wall.grey.at<std::uint8_t>(v, u) = is_light(x, y) ? 150 : 90;
    }
  }
  cv::Mat noise(wall.grey.size(), CV_16SC1);
  random.fill(noise, cv::RNG::NORMAL, 0, 1);
  cv::add(wall.grey, noise, wall.grey, cv::noArray(), CV_8U);
  return wall;
}

bool IsOdd(double metres) { return static_cast<int>(std::floor(metres / 0.21)) % 2 != 0; }

/// Stripes that lean to the right by so much per metre down.
RgbdFrame SeeStripes(int frame, double right_m, double lean, cv::RNG& random) {
  return SeeWall(frame, right_m, 0, random,
                 [lean](double x, double y) { return !IsOdd(x + lean * y); });
}

TEST(EdgeOdometry, StripesDoNotMoveTheCameraAlongThem) {
  EdgeOdometry odometry({}, {525, 525, 319.5, 239.5, 640, 480});
  cv::RNG random(3);
  for (int i = 0; i < 20; ++i) {
    const VoResult result = odometry.Track(SeeStripes(i, 0.012 * i, 0, random));
    ASSERT_EQ(result.state, VoState::kTracking) << i;
    EXPECT_LT(std::abs(result.world_from_camera.translation().y()), 0.05) << i;
  }
}

TEST(EdgeOdometry, WhatStripesDoNotShowGoesOnAsItWas) {
  // At the left the stripes, which lean, have a pattern; the camera sinks while it goes to the
  // right.
  EdgeOdometry odometry({}, {525, 525, 319.5, 239.5, 640, 480});
  cv::RNG random(3);
  const auto is_light = [](double x, double y) {
    return IsOdd(x + 0.01 * y) != (x < 0 && IsOdd(y) != IsOdd(0.6 * y));
  };
  for (int i = 0; i < 30; ++i) {
    const VoResult result = odometry.Track(SeeWall(i, 0.07 * i, 0.02 * i, random, is_light));
    ASSERT_EQ(result.state, VoState::kTracking) << i;
    EXPECT_NEAR(result.world_from_camera.translation().x(), 0.07 * i, 0.02) << i;
    EXPECT_NEAR(result.world_from_camera.translation().y(), 0.02 * i, 0.05) << i;
  }
}

TEST(EdgeOdometry, NoVarianceIsNegativeHoweverShortTheTimeBetweenFrames) {
  // A picture that repeats itself says next to nothing of the movement; in 100 ns there is none.
  RgbdFrame frame;
  frame.depth = cv::Mat(48, 64, CV_32FC1, cv::Scalar(2));
  frame.grey.create(48, 64, CV_8UC1);
  cv::Mat row(1, 61, CV_8UC1);
  cv::RNG random(3);
  random.fill(row, cv::RNG::UNIFORM, 0, 256);
  for (int i = 0; i < 48 * 64; ++i) frame.grey.data[i] = row.at<std::uint8_t>((i + i / 97) % 61);
  EdgeOdometry::Config config;
  config.min_points = 10;
  EdgeOdometry odometry(config, {50, 50, 31.5, 23.5, 64, 48});
  for (int i = 0; i < 3; ++i) {
    frame.stamp_ns = Stamp(0) + 100 * i;
    const VoResult result = odometry.Track(frame);
    ASSERT_EQ(result.state, VoState::kTracking) << i;
    EXPECT_GE(result.covariance.diagonal().minCoeff(), 0) << i;
    EXPECT_GE(result.twist_covariance.diagonal().minCoeff(), 0) << i;
  }
}

TEST(EdgeOdometry, OfAMovementAlongStripesItSaysThatItDoesNotKnowIt) {
  for (const double lean : {0.0, 0.01}) {
    EdgeOdometry odometry({}, {525, 525, 319.5, 239.5, 640, 480});
    cv::RNG random(3);
    int with_velocity = 0;
    for (int i = 0; i < 20; ++i) {
      const VoResult result = odometry.Track(SeeStripes(i, 0.012 * i, lean, random));
      if (!result.twist) continue;
      ++with_velocity;
      const Eigen::Vector3d along = Eigen::Vector3d(-lean, 1, 0).normalized();
      const double variance = along.dot(result.twist_covariance.topLeftCorner<3, 3>() * along);
      EXPECT_GT(variance, 0.5 * 0.5) << "lean " << lean << ", frame " << i;
    }
    EXPECT_GE(with_velocity, 10);
  }
}

TEST(EdgeOdometry, ACornerTellsTheMovementAlongItsStripes) {
  // The walls' stripes go up and down, the floor is bare, and the camera sinks.
  EdgeOdometry odometry({}, kWallCamera);
  const std::array<int, 3> greys = {60, 190, 110};
  for (int i = 0; i < 10; ++i) {
    const Eigen::Isometry3d pose = Pose(0, 0.01 * i, 0, 0, 0, 0);
    RgbdFrame frame;
    frame.stamp_ns = Stamp(i);
    frame.depth = DepthOfCorner(pose);
    frame.grey.create(frame.depth.size(), CV_8UC1);
    for (int v = 0; v < frame.grey.rows; ++v) {
      for (int u = 0; u < frame.grey.cols; ++u) {
        const double depth = frame.depth.at<float>(v, u);
        const double x = (u - kWallCamera.cx) / kWallCamera.fx * depth;
        const double y = 0.01 * i + (v - kWallCamera.cy) / kWallCamera.fy * depth;
        const auto stripe = static_cast<std::size_t>(std::floor((x - depth + 20) / 0.2));
        frame.grey.at<std::uint8_t>(v, u) =
            static_cast<std::uint8_t>(y > 0.79 ? 60 : greys[stripe % 3]);
      }
    }
    cv::GaussianBlur(frame.grey, frame.grey, {5, 5}, 0);
    const VoResult result = odometry.Track(frame);
    ASSERT_EQ(result.state, VoState::kTracking) << i;
    EXPECT_NEAR(result.world_from_camera.translation().y(), 0.01 * i, 4e-3) << i;
    EXPECT_LT(result.covariance(1, 1), 0.01 * 0.01) << i;
  }
}

}  // namespace
}  // namespace livemap::odometry
