#include "nodelets/change_detection/posed_frame_queue.h"

#include <gtest/gtest.h>

#include <boost/make_shared.hpp>

namespace livemap::nodelets {
namespace {

constexpr double kMetresPerDegree = 111195;  // Of latitude, near enough.
constexpr std::int64_t kSecondNs = 1'000'000'000;

PosedFrameQueue::Config Config() {
  PosedFrameQueue::Config config;
  config.spacing_m = 16;
  config.max_waiting = 3;
  return config;
}

/// To the north at 8 m/s.
geo::Fix FixAt(double seconds) {
  geo::Fix fix;
  fix.stamp_ns = static_cast<std::int64_t>(seconds * kSecondNs) + 100 * kSecondNs;
  fix.has_fix = true;
  fix.position = {8 * seconds / kMetresPerDegree, 0};
  fix.covariance_m2 = 0.01 * Eigen::Matrix2d::Identity();
  return fix;
}

sensor_msgs::ImageConstPtr ImageAt(double seconds) {
  auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.stamp = ros::Time(100) + ros::Duration(seconds);
  return image;
}

TEST(PosedFrameQueue, GivesAnImageOnceItsPositionIsKnownAndTheRoadWasDriven) {
  PosedFrameQueue frames(Config());
  for (double seconds = 0; seconds < 2; seconds += 0.5) frames.AddFix(FixAt(seconds));
  frames.AddImage(ImageAt(1.7), 50);
  EXPECT_FALSE(frames.Next(50.01)) << "the fix after it may come";
  for (double seconds = 2; seconds < 9; seconds += 0.5) frames.AddFix(FixAt(seconds));
  const auto first = frames.Next(50.02);
  ASSERT_TRUE(first);
  EXPECT_NEAR(first->base.position.latitude_deg * kMetresPerDegree, 13.6, 0.2);
  EXPECT_NEAR(first->base.course_rad, 0, 0.1);
  frames.Taken(*first);
  frames.AddImage(ImageAt(3.2), 51);
  EXPECT_FALSE(frames.Next(51)) << "only 12 m further";
  frames.AddImage(ImageAt(3.9), 52);
  EXPECT_TRUE(frames.Next(52));
  EXPECT_EQ(frames.counters().frames, 3U);
  EXPECT_EQ(frames.counters().near, 1U);
}

TEST(PosedFrameQueue, AnImageThatWasNotTakenDoesNotCountAsLookedAt) {
  PosedFrameQueue frames(Config());
  for (double seconds = 0; seconds < 9; seconds += 0.5) frames.AddFix(FixAt(seconds));
  frames.AddImage(ImageAt(2.0), 50);
  ASSERT_TRUE(frames.Next(50));
  frames.AddImage(ImageAt(2.1), 50.1);
  EXPECT_TRUE(frames.Next(50.1)) << "the first one was skipped: this one is as good";
}

TEST(PosedFrameQueue, AnImageWaitsForItsDepthButNotForEver) {
  PosedFrameQueue::Config config = Config();
  config.depth_wait_s = 0.3;
  PosedFrameQueue frames(config);
  for (double seconds = 0; seconds < 20; seconds += 0.5) frames.AddFix(FixAt(seconds));
  frames.AddDepth(ImageAt(2.0));
  frames.AddImage(ImageAt(2.0), 50);
  const auto early = frames.Next(50);
  ASSERT_TRUE(early) << "its depth came first";
  EXPECT_EQ(early->depth->header.stamp, early->image->header.stamp);
  frames.Taken(*early);

  frames.AddImage(ImageAt(5.0), 51);
  EXPECT_FALSE(frames.Next(51.2));
  frames.AddDepth(ImageAt(4.9));
  EXPECT_FALSE(frames.Next(51.2)) << "of another image";
  frames.AddDepth(ImageAt(5.0));
  ASSERT_TRUE(frames.Next(51.2));

  frames.AddImage(ImageAt(8.0), 52);
  EXPECT_FALSE(frames.Next(52.29));
  const auto late = frames.Next(52.31);
  ASSERT_TRUE(late);
  EXPECT_FALSE(late->depth);

  frames.Taken(*late);
  frames.AddImage(ImageAt(8.1), 53);
  frames.AddImage(ImageAt(11.0), 53);
  frames.AddDepth(ImageAt(11.0));
  const auto next = frames.Next(53);
  ASSERT_TRUE(next) << "one that is too near is not waited for";
  EXPECT_TRUE(next->depth);
}

TEST(PosedFrameQueue, WithoutPositionsTheOldestGoAndTheOthersAreGivenUp) {
  PosedFrameQueue frames(Config());
  for (int i = 0; i < 5; ++i) frames.AddImage(ImageAt(i), 50);
  EXPECT_EQ(frames.waiting(), 3U);
  EXPECT_EQ(frames.counters().displaced, 2U);
  EXPECT_FALSE(frames.Next(51));
  EXPECT_FALSE(frames.Next(100));
  EXPECT_EQ(frames.counters().no_pose, 3U);
  EXPECT_EQ(frames.waiting(), 0U);
}

TEST(PosedFrameQueue, AfterALoopOfTheClockImagesAndDepthsComeAsBefore) {
  PosedFrameQueue::Config config = Config();
  config.depth_wait_s = 0.3;
  PosedFrameQueue frames(config);
  for (double seconds = 0; seconds < 22; seconds += 0.5) frames.AddFix(FixAt(seconds));
  for (const double seconds : {20.0, 20.5, 21.0}) frames.AddDepth(ImageAt(seconds));
  frames.AddImage(ImageAt(23.0), 50);
  frames.StartAnew();
  EXPECT_EQ(frames.waiting(), 0U);
  EXPECT_EQ(frames.counters().no_pose, 1U);
  for (double seconds = 0; seconds < 9; seconds += 0.5) frames.AddFix(FixAt(seconds));
  frames.AddDepth(ImageAt(7.0));
  frames.AddImage(ImageAt(7.0), 51);
  const auto posed = frames.Next(51);
  ASSERT_TRUE(posed);
  EXPECT_TRUE(posed->depth) << "those of before do not displace it";
}

}  // namespace
}  // namespace livemap::nodelets
