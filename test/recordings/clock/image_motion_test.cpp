#include "recordings/clock/image_motion.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace livemap::recordings {
namespace {

/// A picture with corners everywhere.
cv::Mat Texture() {
  cv::Mat texture(180, 320, CV_8UC1);
  cv::RNG random(7);
  random.fill(texture, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(texture, texture, {}, 3);
  cv::normalize(texture, texture, 0, 255, cv::NORM_MINMAX);
  return texture;
}

/// The texture moved and enlarged about its middle.
cv::Mat Moved(double right, double scale) {
  const cv::Mat texture = Texture();
  const cv::Matx23d warp(scale, 0, 160 * (1 - scale) + right, 0, scale, 90 * (1 - scale));
  cv::Mat moved;
  cv::warpAffine(texture, moved, warp, texture.size(), cv::INTER_LINEAR, cv::BORDER_REFLECT);
  return moved;
}

std::optional<ImageMotion> MotionBetween(const cv::Mat& a, const cv::Mat& b) {
  ImageMotionMeter meter;
  meter.Add(a, 1'000'000'000);
  return meter.Add(b, 1'100'000'000);
}

TEST(ImageMotion, APictureThatMovesLeftIsATurnToTheRight) {
  const auto motion = MotionBetween(Moved(0, 1), Moved(-4, 1));
  ASSERT_TRUE(motion);
  EXPECT_EQ(motion->stamp_ns, 1'050'000'000);
  // 4 of 320 pixels in 0.1 s, over the focal length.
  EXPECT_NEAR(motion->turn_radps, 0.125 / ImageMotionMeter::kFocal, 0.02);
}

TEST(ImageMotion, MovingAheadIsNoTurn) {
  const auto motion = MotionBetween(Moved(0, 1), Moved(0, 1.04));
  ASSERT_TRUE(motion);
  EXPECT_NEAR(motion->turn_radps, 0, 0.01);
  EXPECT_GT(motion->flow, 0.05);
}

TEST(ImageMotion, AVehicleThatStandsSeesNoFlow) {
  const auto motion = MotionBetween(Moved(0, 1), Moved(0, 1));
  ASSERT_TRUE(motion);
  EXPECT_NEAR(motion->flow, 0, 1e-3);
}

TEST(ImageMotion, NothingIsSaidOfAPictureWithoutCornersOrAfterAGap) {
  EXPECT_FALSE(MotionBetween(cv::Mat(180, 320, CV_8UC1, cv::Scalar(0)),
                             cv::Mat(180, 320, CV_8UC1, cv::Scalar(0))));
  ImageMotionMeter meter;
  meter.Add(Moved(0, 1), 1'000'000'000);
  EXPECT_FALSE(meter.Wants(1'010'000'000));
  EXPECT_FALSE(meter.Add(Moved(0, 1), 9'000'000'000));
}

}  // namespace
}  // namespace livemap::recordings
