#include "odometry/monocular/monocular_odometry.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <thread>
#include <vector>

#include "common/error.h"
#include "geo/wgs84.h"
#include "simulation/room/room_motion.h"
#include "simulation/room/simulated_room.h"

namespace livemap::odometry {
namespace {

constexpr double kFrameS = 0.1;
constexpr double kSpeedMps = 0.6;
constexpr int kFrames = 18;

/// Half the size of the simulator's: the room is rendered for minutes under sanitizers.
simulation::SimulatedCamera WalkCamera() {
  simulation::SimulatedCamera camera;
  camera.intrinsics = {250, 250, 159.5, 119.5, 320, 240};
  return camera;
}

/// A camera that goes sideways and forward through the simulated room, and turns a little.
struct Walk {
  std::vector<cv::Mat> grey;
  std::vector<Eigen::Isometry3d> first_from_camera;
};

const Walk& TheWalk() {
  static const Walk walk = [] {
    const simulation::SimulatedRoom room(1);
    const Eigen::Isometry3d start =
        RoomCameraPose(room.plan(), simulation::RoomMotion::kHand, 0, 1);
    Walk made;
    for (int i = 0; i < kFrames; ++i) {
      const double way = kSpeedMps * kFrameS * i;
      Vector6d twist;
      twist << 0.8 * way, 0, 0.6 * way, 0, 0.05 * way, 0;
      const Eigen::Isometry3d first_from_camera = Se3Exp(twist);
      const simulation::SimulatedFrame seen = room.Render(
          WalkCamera(), start * first_from_camera, static_cast<std::uint32_t>(i), 1.3F, 1, 2);
      cv::Mat grey;
      cv::cvtColor(seen.bgr, grey, cv::COLOR_BGR2GRAY);
      made.grey.push_back(grey);
      made.first_from_camera.push_back(first_from_camera);
    }
    return made;
  }();
  return walk;
}

MonocularOdometry::Config Slow() {
  MonocularOdometry::Config config;
  config.depth.min_depth_m = 0.3F;
  config.depth.max_depth_m = 20.0F;
  config.min_speed_mps = 0.1;
  config.speed_sigma_mps = 0.02;
  return config;
}

MonocularFrame Frame(int i, std::optional<double> speed_mps = kSpeedMps) {
  MonocularFrame frame;
  frame.stamp_ns = static_cast<std::int64_t>(i * kFrameS * 1e9);
  frame.grey = TheWalk().grey[static_cast<std::size_t>(i)];
  frame.speed_mps = speed_mps;
  return frame;
}

double WalkErrorM(const VoResult& result, int i) {
  return (result.world_from_camera.translation() -
          TheWalk().first_from_camera[static_cast<std::size_t>(i)].translation())
      .norm();
}

TEST(MonocularOdometry, FollowsTheCameraInMetresWithASpeed) {
  MonocularOdometry odometry(Slow(), WalkCamera().intrinsics);
  VoResult result;
  for (int i = 0; i < kFrames; ++i) result = odometry.Track(Frame(i));
  const double way = kSpeedMps * kFrameS * (kFrames - 1);
  EXPECT_EQ(result.state, VoState::kTracking);
  EXPECT_LT(WalkErrorM(result, kFrames - 1), 0.05 * way);
  const Eigen::AngleAxisd turn(result.world_from_camera.linear().transpose() *
                               TheWalk().first_from_camera.back().linear());
  EXPECT_LT(std::abs(turn.angle()), 0.035) << "rad";
  ASSERT_TRUE(result.twist);
  EXPECT_NEAR(result.twist->head<3>().norm(), kSpeedMps, 0.05 * kSpeedMps);
  const double sigma_m = std::sqrt(result.covariance.topLeftCorner<3, 3>().trace());
  EXPECT_GT(sigma_m, 0.1 * WalkErrorM(result, kFrames - 1));
}

TEST(MonocularOdometry, DepthsOfItsEdgesAreThoseOfTheRoom) {
  const simulation::SimulatedRoom room(1);
  MonocularOdometry odometry(Slow(), WalkCamera().intrinsics);
  int last_keyframe = 0;
  for (int i = 0; i < kFrames; ++i) {
    if (odometry.Track(Frame(i)).new_keyframe) last_keyframe = i;
  }
  const simulation::SimulatedFrame truth =
      room.Render(WalkCamera(),
                  RoomCameraPose(room.plan(), simulation::RoomMotion::kHand, 0, 1) *
                      TheWalk().first_from_camera[static_cast<std::size_t>(last_keyframe)],
                  0, 1.3F, 1, 2);
  std::size_t known = 0, right = 0;
  for (const EdgeDepth& edge : odometry.depths().edges()) {
    if (!edge.known) continue;
    ++known;
    const float depth_m = odometry.metres_per_unit() > 0
                              ? static_cast<float>(odometry.metres_per_unit()) / edge.inverse_depth
                              : 0;
    // An edge belongs to the nearer of two surfaces, which may lie beside its pixel.
    float best = std::numeric_limits<float>::infinity();
    for (int dy = -2; dy <= 2; ++dy) {
      for (int dx = -2; dx <= 2; ++dx) {
        best =
            std::min(best, std::abs(truth.depth.at<float>(edge.v + dy, edge.u + dx) / depth_m - 1));
      }
    }
    right += best < 0.1F ? 1U : 0U;
  }
  EXPECT_GT(known, 1500U);
  EXPECT_GT(static_cast<double>(right), 0.85 * static_cast<double>(known));
}

TEST(MonocularOdometry, InitialisesUntilTheCameraMoves) {
  MonocularOdometry odometry(Slow(), WalkCamera().intrinsics);
  for (int i = 0; i < 5; ++i) {
    MonocularFrame frame = Frame(0, 0.0);
    frame.stamp_ns = std::int64_t{100'000'000} * i;
    const VoResult result = odometry.Track(frame);
    EXPECT_EQ(result.state, VoState::kInitialising);
    EXPECT_TRUE(result.world_from_camera.isApprox(Eigen::Isometry3d::Identity()));
  }
}

TEST(MonocularOdometry, TellsWhichFrameStandsAtTheOrigin) {
  MonocularOdometry odometry(Slow(), WalkCamera().intrinsics);
  constexpr int kCovered = 2;
  int started = 0;
  VoResult result;
  for (int i = 0; i < kFrames && result.state != VoState::kTracking; ++i) {
    MonocularFrame frame = Frame(i);
    if (i < kCovered) frame.grey = cv::Mat(frame.grey.size(), CV_8UC1, cv::Scalar(0));
    result = odometry.Track(frame);
    started = i;
  }
  ASSERT_EQ(result.state, VoState::kTracking);
  ASSERT_GT(started, kCovered);
  EXPECT_EQ(odometry.start_stamp_ns(), Frame(kCovered).stamp_ns);
  const double way_m = kSpeedMps * kFrameS * (started - kCovered);
  EXPECT_NEAR(result.world_from_camera.translation().norm(), way_m, 0.1 * way_m);
}

TEST(MonocularOdometry, HoldsThePoseInTheDarkAndStartsAnewAfterwards) {
  MonocularOdometry::Config config = Slow();
  config.give_up_s = 0.25;
  MonocularOdometry odometry(config, WalkCamera().intrinsics);
  VoResult before;
  for (int i = 0; i < 8; ++i) before = odometry.Track(Frame(i));
  ASSERT_EQ(before.state, VoState::kTracking);
  VoResult dark;
  for (int i = 8; i < 13; ++i) {
    MonocularFrame frame = Frame(i);
    frame.grey = cv::Mat(frame.grey.size(), CV_8UC1, cv::Scalar(0));
    dark = odometry.Track(frame);
    EXPECT_EQ(dark.state, VoState::kLost);
    EXPECT_TRUE(dark.world_from_camera.isApprox(before.world_from_camera, 1e-9));
  }
  EXPECT_GT(dark.covariance.trace(), before.covariance.trace());
  VoResult after;
  for (int i = 13; i < kFrames; ++i) after = odometry.Track(Frame(i));
  EXPECT_EQ(after.state, VoState::kTracking);
  EXPECT_GT(after.covariance.trace(), dark.covariance.trace()) << "what was unknown stays unknown";
  // What it moved in the dark, and until it could start, is not known.
  EXPECT_GT(after.world_from_camera.translation().norm(),
            before.world_from_camera.translation().norm());
}

TEST(MonocularOdometry, IsDeterministicAndResetForgetsEverything) {
  MonocularOdometry odometry(Slow(), WalkCamera().intrinsics);
  VoResult first, second;
  for (int i = 0; i < 10; ++i) first = odometry.Track(Frame(i));
  odometry.Reset();
  for (int i = 0; i < 10; ++i) second = odometry.Track(Frame(i));
  EXPECT_EQ(first.state, second.state);
  EXPECT_TRUE(first.world_from_camera.matrix() == second.world_from_camera.matrix());
}

/// As on board: metres by whatever there is.
MonocularOdometry::Config OnBoard() {
  MonocularOdometry::Config config = Slow();
  config.scale_source = ScaleSource::kBest;
  config.camera_height_m = 0;
  config.fixes.lever_m = 0;
  return config;
}

/// The receiver's fix at the moment of an image of the walk, exact to a centimetre.
geo::Fix FixOfWalk(int i) {
  const Eigen::Vector3d place =
      TheWalk().first_from_camera[static_cast<std::size_t>(i)].translation();
  geo::Fix fix;
  fix.stamp_ns = Frame(i).stamp_ns;
  fix.position = geo::LocalFrame({48.8566, 9.0}).ToGeo({place.x(), place.z()});
  fix.covariance_m2 = 1e-4 * Eigen::Matrix2d::Identity();
  return fix;
}

/// The walk's frames and fixes with stamps after 1970, as fixes must have.
MonocularFrame LaterFrame(int i, std::optional<double> speed_mps) {
  MonocularFrame frame = Frame(i, speed_mps);
  frame.stamp_ns += 1'700'000'000'000'000'000;
  return frame;
}

TEST(MonocularOdometry, WithoutMetresThePoseIsHeldUntilFixesTellThem) {
  MonocularOdometry odometry(OnBoard(), WalkCamera().intrinsics);
  VoResult result;
  int told = -1;
  for (int i = 0; i < kFrames; ++i) {
    if (i > 0) {
      geo::Fix fix = FixOfWalk(i - 1);  // A little late, as a receiver's are.
      fix.stamp_ns += 1'700'000'000'000'000'000;
      odometry.AddFix(fix);
    }
    result = odometry.Track(LaterFrame(i, std::nullopt));
    if (result.state == VoState::kTracking && told < 0) told = i;
    if (told < 0) {
      EXPECT_EQ(result.state, VoState::kInitialising);
      EXPECT_TRUE(result.world_from_camera.isApprox(Eigen::Isometry3d::Identity()));
    }
  }
  ASSERT_GT(told, 0);
  EXPECT_EQ(odometry.metres_source(), MetresSource::kFixes);
  // The path begins with the last frame before.
  const double way_m = kSpeedMps * kFrameS * (kFrames - told);
  EXPECT_NEAR(result.world_from_camera.translation().norm(), way_m, 0.1 * way_m);
  ASSERT_TRUE(odometry.metres_sigma());
  EXPECT_LT(*odometry.metres_sigma(), 0.1);
}

TEST(MonocularOdometry, NoiseOfAGreyLevelHardlyMovesTheMetresByFixes) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    MonocularOdometry odometry(OnBoard(), WalkCamera().intrinsics);
    cv::RNG random(seed);
    std::optional<int> begin;
    Eigen::Isometry3d world_from_begin = Eigen::Isometry3d::Identity();
    VoResult result;
    for (int i = 0; i < kFrames; ++i) {
      if (i > 0) {
        geo::Fix fix = FixOfWalk(i - 1);
        fix.stamp_ns += 1'700'000'000'000'000'000;
        odometry.AddFix(fix);
      }
      MonocularFrame frame = LaterFrame(i, std::nullopt);
      cv::Mat noise(frame.grey.size(), CV_16SC1), noisy;
      random.fill(noise, cv::RNG::NORMAL, 0, 1);
      cv::add(frame.grey, noise, noisy, cv::noArray(), CV_8U);
      frame.grey = noisy;
      result = odometry.Track(frame);
      if (result.state != VoState::kTracking || begin) continue;
      begin = i;
      world_from_begin = result.world_from_camera;
    }
    ASSERT_TRUE(begin) << "seed " << seed;
    const double way_m = kSpeedMps * kFrameS * (kFrames - 1 - *begin);
    EXPECT_NEAR((world_from_begin.inverse() * result.world_from_camera).translation().norm(), way_m,
                0.1 * way_m)
        << "seed " << seed;
  }
}

TEST(MonocularOdometry, WhenTheSpeedEndsTheMetresAreHeldLessAndLessCertain) {
  MonocularOdometry::Config config = OnBoard();
  config.source_age_s = 0.3;
  MonocularOdometry odometry(config, WalkCamera().intrinsics);
  VoResult result;
  std::optional<double> at_start;
  for (int i = 0; i < kFrames; ++i) {
    result =
        odometry.Track(LaterFrame(i, at_start ? std::nullopt : std::optional<double>(kSpeedMps)));
    if (result.state != VoState::kTracking || at_start) continue;
    at_start = odometry.metres_sigma();
    ASSERT_TRUE(at_start);
    EXPECT_EQ(odometry.metres_source(), MetresSource::kReceiver);
  }
  EXPECT_EQ(odometry.metres_source(), MetresSource::kNone);
  ASSERT_TRUE(at_start);
  EXPECT_GT(*odometry.metres_sigma(), *at_start);
  EXPECT_LT(WalkErrorM(result, kFrames - 1), 0.06 * kSpeedMps * kFrameS * (kFrames - 1));
}

TEST(MonocularOdometry, ACameraThatTurnsOnTheSpotDoesNotStart) {
  const simulation::SimulatedRoom room(1);
  const Eigen::Isometry3d start = RoomCameraPose(room.plan(), simulation::RoomMotion::kHand, 0, 1);
  MonocularOdometry odometry(Slow(), WalkCamera().intrinsics);
  for (int i = 0; i < 8; ++i) {
    Vector6d twist = Vector6d::Zero();
    twist[4] = 0.02 * i;
    const simulation::SimulatedFrame seen =
        room.Render(WalkCamera(), start * Se3Exp(twist), static_cast<std::uint32_t>(i), 1.3F, 1, 2);
    MonocularFrame frame = Frame(i);
    cv::cvtColor(seen.bgr, frame.grey, cv::COLOR_BGR2GRAY);
    EXPECT_EQ(odometry.Track(frame).state, VoState::kInitialising) << i;
  }
}

TEST(MonocularOdometry, AKeyframeThatComesFramesLaterGivesThePathAllTheSame) {
  MonocularOdometry::Config config = Slow();
  config.keyframe_delay = 2;
  MonocularOdometry odometry(config, WalkCamera().intrinsics);
  VoResult result;
  int keyframes = 0;
  for (int i = 0; i < kFrames; ++i) {
    result = odometry.Track(Frame(i));
    keyframes += result.new_keyframe ? 1 : 0;
  }
  EXPECT_EQ(result.state, VoState::kTracking);
  EXPECT_GE(keyframes, 2);
  EXPECT_LT(WalkErrorM(result, kFrames - 1), 0.05 * kSpeedMps * kFrameS * (kFrames - 1));
  odometry.Reset();
  VoResult second;
  for (int i = 0; i < kFrames; ++i) second = odometry.Track(Frame(i));
  EXPECT_TRUE(result.world_from_camera.matrix() == second.world_from_camera.matrix())
      << "it can be repeated";
}

TEST(MonocularOdometry, MakesKeyframesOnAThreadOfTheirOwn) {
  MonocularOdometry::Config config = Slow();
  config.background = true;
  MonocularOdometry odometry(config, WalkCamera().intrinsics);
  VoResult result;
  int keyframes = 0;
  for (int i = 0; i < kFrames; ++i) {
    result = odometry.Track(Frame(i));
    keyframes += result.new_keyframe ? 1 : 0;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // As from a camera.
  }
  EXPECT_EQ(result.state, VoState::kTracking);
  EXPECT_GE(keyframes, 1) << "that of the start; on a busy machine others may come later";
  EXPECT_LT(WalkErrorM(result, kFrames - 1), 0.1 * kSpeedMps * kFrameS * (kFrames - 1));
  odometry.Reset();  // With a keyframe in work or not.
  EXPECT_EQ(odometry.Track(Frame(0)).state, VoState::kInitialising);
}

TEST(MonocularOdometry, RefusesWrongImagesAndStampsAndGoesOn) {
  MonocularOdometry odometry(Slow(), WalkCamera().intrinsics);
  odometry.Track(Frame(0));
  MonocularFrame small = Frame(1);
  small.grey = cv::Mat(1, 1, CV_8UC1);
  EXPECT_THROW(odometry.Track(small), Error);
  EXPECT_THROW(odometry.Track(Frame(0)), Error);
  EXPECT_THROW(odometry.Track(Frame(1, std::numeric_limits<double>::quiet_NaN())), Error);
  VoResult result;
  for (int i = 1; i < 10; ++i) result = odometry.Track(Frame(i));
  EXPECT_EQ(result.state, VoState::kTracking);
}

}  // namespace
}  // namespace livemap::odometry
