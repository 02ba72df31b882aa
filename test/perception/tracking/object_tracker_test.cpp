#include "perception/tracking/object_tracker.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/error.h"

namespace livemap::perception {
namespace {

constexpr std::int64_t kFrameNs = 100'000'000;
const cv::Size kImage(640, 400);

HazardDetection Found(float confidence, const cv::Rect2f& box, int class_index = 0) {
  return {class_index == 0 ? "pothole" : "deer", class_index, confidence, box};
}

/// A camera 1.5 m above the road that looks 10 degrees down, `way_m` along a straight road.
CameraMotion After(double way_m) {
  CameraMotion motion;
  motion.intrinsics = {500, 500, 319.5, 199.5, kImage.width, kImage.height};
  const double pitch = 10 * M_PI / 180;
  Eigen::Matrix3d optical;
  optical << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  motion.base_from_optical.linear() =
      Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()).toRotationMatrix() * optical;
  motion.base_from_optical.translation() = Eigen::Vector3d(0, 0, 1.5);
  motion.world_from_base.translation() = Eigen::Vector3d(way_m, 0, 0);
  return motion;
}

/// The box of an object that lies on the road, 1 m wide, `ahead_m` to `ahead_m` + 1 before the car.
cv::Rect2f BoxAt(double ahead_m, double left_m) {
  const CameraMotion camera = After(0);
  const auto pixel = [&](double x, double y) {
    const Eigen::Vector3d p = camera.base_from_optical.inverse() * Eigen::Vector3d(x, y, 0);
    return Eigen::Vector2d(500 * p.x() / p.z() + 319.5, 500 * p.y() / p.z() + 199.5);
  };
  const Eigen::Vector2d near_left = pixel(ahead_m, left_m + 0.5);
  const Eigen::Vector2d near_right = pixel(ahead_m, left_m - 0.5);
  const Eigen::Vector2d far_left = pixel(ahead_m + 1, left_m + 0.5);
  return {static_cast<float>(near_left.x()), static_cast<float>(far_left.y()),
          static_cast<float>(near_right.x() - near_left.x()),
          static_cast<float>(near_left.y() - far_left.y())};
}

class ObjectTrackerTest : public ::testing::Test {
 protected:
  /// Adds the next frame and keeps its events.
  std::size_t Add(std::vector<HazardDetection> found, std::optional<CameraMotion> motion = {}) {
    now_ns_ += kFrameNs;
    const auto events = tracker_.Add({now_ns_, kImage, std::move(found), std::move(motion)});
    events_.insert(events_.end(), events.begin(), events.end());
    return events.size();
  }
  void Restart(const ObjectTracker::Config& config) {
    tracker_ = ObjectTracker(config, {0.4F, 0.2F});
  }

  ObjectTracker tracker_{ObjectTracker::Config(), {0.4F, 0.2F}};
  std::int64_t now_ns_ = 0;
  std::vector<ObjectEvent> events_;
};

TEST_F(ObjectTrackerTest, AnObjectThatComesNearerIsOneEventAtItsBestView) {
  for (int i = 0; i < 8; ++i) {
    const float confidence = i == 5 ? 0.9F : 0.6F;
    Add({Found(confidence, BoxAt(20 - 2 * i, 0.5))}, After(2 * i));
  }
  const auto late = tracker_.Finish();
  events_.insert(events_.end(), late.begin(), late.end());
  ASSERT_EQ(events_.size(), 1U);
  EXPECT_EQ(events_[0].stamp_ns, 6 * kFrameNs);
  EXPECT_FLOAT_EQ(events_[0].detection.confidence, 0.9F);
  EXPECT_EQ(tracker_.counters().tracks, 1U);
}

TEST_F(ObjectTrackerTest, LowScoresKeepATrackAndAddUp) {
  ObjectTracker::Config config;
  config.repeat_gain = 0.3;
  Restart(config);
  // One sight of 0.3 is not sure, 0.3 + 0.3 * 0.3 neither, 0.3 + 0.3 * 0.6 is.
  for (int i = 0; i < 2; ++i) Add({Found(0.3F, BoxAt(20 - 2 * i, 0))}, After(2 * i));
  ObjectTracker two = tracker_;
  EXPECT_TRUE(two.Finish().empty());
  Add({Found(0.3F, BoxAt(16, 0))}, After(4));
  EXPECT_EQ(tracker_.Finish().size(), 1U);
  EXPECT_EQ(tracker_.counters().tracks, 1U);
}

TEST_F(ObjectTrackerTest, WhatIsBelowTheLowShareTakesNoPart) {
  Add({Found(0.1F, BoxAt(20, 0))}, After(0));
  EXPECT_EQ(tracker_.living(), 0U);
}

TEST_F(ObjectTrackerTest, TheMotionOfTheCameraCarriesABoxOverALongWay) {
  // 6 m between images: the box is elsewhere and twice as large.
  Add({Found(0.6F, BoxAt(14, 0.5))}, After(0));
  Add({Found(0.6F, BoxAt(8, 0.5))}, After(6));
  EXPECT_EQ(tracker_.counters().tracks, 1U);
  Restart({});
  Add({Found(0.6F, BoxAt(14, 0.5))});
  Add({Found(0.6F, BoxAt(8, 0.5))});
  EXPECT_EQ(tracker_.counters().tracks, 2U);
}

TEST_F(ObjectTrackerTest, WithoutMotionTheVelocityInTheImageCarriesABox) {
  for (int i = 0; i < 5; ++i) {
    Add({Found(0.6F, {100.0F + 30.0F * static_cast<float>(i), 200, 40, 40})});
  }
  EXPECT_EQ(tracker_.counters().tracks, 1U);
}

TEST_F(ObjectTrackerTest, TwoObjectsSideBySideStayTwo) {
  for (int i = 0; i < 5; ++i) {
    Add({Found(0.6F, BoxAt(18 - 2 * i, 1.5)), Found(0.6F, BoxAt(18 - 2 * i, -1.5))}, After(2 * i));
  }
  EXPECT_EQ(tracker_.counters().tracks, 2U);
  EXPECT_EQ(tracker_.Finish().size(), 2U);
}

TEST_F(ObjectTrackerTest, AnUrgentClassIsReportedAtOnceAndOthersWaitAtMostTheirDelay) {
  EXPECT_EQ(Add({Found(0.5F, BoxAt(20, 0), 1)}, After(0)), 1U);
  Restart({});
  std::size_t events = 0;
  int frames = 0;
  for (; frames < 40 && events == 0; ++frames) events = Add({Found(0.5F, BoxAt(20, 0))}, After(0));
  EXPECT_EQ(frames, 21);  // sure in the first, 2 s later
  for (; frames < 60; ++frames) EXPECT_EQ(Add({Found(0.5F, BoxAt(20, 0))}, After(0)), 0U);
}

TEST_F(ObjectTrackerTest, AnObjectThatLeftTheViewIsReported) {
  Add({Found(0.6F, BoxAt(6, 0))}, After(0));
  EXPECT_EQ(Add({}, After(2)), 0U);
  EXPECT_EQ(Add({}, After(5)), 1U);
  EXPECT_EQ(tracker_.living(), 0U);
}

TEST_F(ObjectTrackerTest, AViewThatTheEdgeCutsIsNotTheBest) {
  Add({Found(0.6F, {300, 340, 40, 40})});
  Add({Found(0.7F, {300, 360, 40, 40})});
  // The cut view is past the best one.
  ASSERT_EQ(events_.size(), 1U);
  EXPECT_EQ(events_[0].stamp_ns, kFrameNs);
  EXPECT_TRUE(tracker_.Finish().empty());
}

TEST_F(ObjectTrackerTest, BoxesThatAreNoneAreRefusedAndCounted) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Add({Found(0.6F, {nan, 0, 10, 10}), Found(0.6F, {0, 0, 0, 10}), Found(nan, {0, 0, 10, 10}),
       Found(0.6F, {0, 0, 10, 10}, 7), Found(0.6F, {0, 0, 10, -5})});
  EXPECT_EQ(tracker_.counters().refused, 5U);
  EXPECT_EQ(tracker_.living(), 0U);
}

TEST_F(ObjectTrackerTest, AnImageThatComesLateChangesNothing) {
  Add({Found(0.6F, BoxAt(20, 0))}, After(0));
  Add({Found(0.6F, BoxAt(18, 0))}, After(2));
  now_ns_ -= 2 * kFrameNs;
  EXPECT_EQ(Add({Found(0.6F, BoxAt(20, 0))}, After(0)), 0U) << "the first image again";
  now_ns_ += kFrameNs;
  Add({Found(0.6F, BoxAt(16, 0))}, After(4));
  EXPECT_EQ(tracker_.counters().late, 1U);
  EXPECT_EQ(tracker_.counters().tracks, 1U) << "the object is still the same one";
  EXPECT_EQ(tracker_.counters().resets, 0U);
}

TEST_F(ObjectTrackerTest, AStampBeyondAllLatenessBeginsAnew) {
  now_ns_ = 3600 * std::int64_t{1'000'000'000};
  Add({Found(0.6F, BoxAt(20, 0))}, After(0));
  now_ns_ = 0;
  EXPECT_EQ(Add({}, After(0)), 0U);
  EXPECT_EQ(tracker_.counters().resets, 1U);
  EXPECT_EQ(tracker_.living(), 0U);
}

TEST_F(ObjectTrackerTest, AfterStartingAnewTheNextImageIsTheFirstWhateverItsStamp) {
  Add({Found(0.6F, BoxAt(20, 0))}, After(0));
  tracker_.StartAnew();
  EXPECT_EQ(tracker_.living(), 0U);
  now_ns_ -= kFrameNs;
  Add({Found(0.6F, BoxAt(20, 0))}, After(0));
  EXPECT_EQ(tracker_.living(), 1U);
  EXPECT_EQ(tracker_.counters().late, 0U);
}

TEST_F(ObjectTrackerTest, MotionThatIsNoNumberFallsBackOnTheImage) {
  CameraMotion broken = After(0);
  broken.world_from_base.translation().x() = std::numeric_limits<double>::quiet_NaN();
  Add({Found(0.6F, BoxAt(20, 0))}, After(0));
  Add({Found(0.6F, BoxAt(20, 0))}, broken);
  EXPECT_EQ(tracker_.counters().tracks, 1U);
}

TEST_F(ObjectTrackerTest, TheNumberOfTracksIsBounded) {
  ObjectTracker::Config config;
  config.max_tracks = 3;
  Restart(config);
  std::vector<HazardDetection> many;
  for (int i = 0; i < 10; ++i) {
    const auto number = static_cast<float>(i);
    many.push_back(Found(0.3F + 0.005F * number, {60 * number, 100, 20, 20}));
  }
  Add(many);
  EXPECT_LE(tracker_.living(), 3U);
  EXPECT_EQ(tracker_.counters().forgotten, 7U);
}

TEST(ObjectTrackerConfig, NumbersOutOfRangeAreNamed) {
  ObjectTracker::Config config;
  config.sure = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(ObjectTracker(config, {0.4F}), Error);
}

}  // namespace
}  // namespace livemap::perception
