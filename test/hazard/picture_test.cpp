#include "hazard/picture.h"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>

namespace livemap {
namespace {

/// Noise: what JPEG compresses worst.
Picture Noise(int width, int height) {
  Picture picture{cv::Mat(height, width, CV_8UC3), nullptr};
  cv::RNG random(17);
  random.fill(picture.bgr, cv::RNG::UNIFORM, 0, 256);
  return picture;
}

TEST(EncodeJpeg, KeepsSizeWithinTheBudget) {
  const auto file = EncodeJpeg(Noise(320, 200), 90, 200000);
  EXPECT_EQ(cv::imdecode(file, cv::IMREAD_COLOR).size(), cv::Size(320, 200));
}

TEST(EncodeJpeg, MeetsTheBudgetByLowerQualityAndThenBySize) {
  for (const std::size_t budget : {60000u, 20000u, 8000u}) {
    const auto file = EncodeJpeg(Noise(320, 200), 90, budget);
    ASSERT_FALSE(file.empty());
    EXPECT_LE(file.size(), budget);
    EXPECT_FALSE(cv::imdecode(file, cv::IMREAD_COLOR).empty());
  }
}

TEST(EncodeJpeg, ImpossibleBudgetGivesNoPicture) {
  EXPECT_TRUE(EncodeJpeg(Noise(320, 200), 90, 100).empty());
  EXPECT_TRUE(EncodeJpeg(Noise(320, 200), 90, 0).empty());
}

TEST(EncodeJpeg, WhatIsNoColourImageGivesNoPicture) {
  EXPECT_TRUE(EncodeJpeg(Picture{}, 90, 100000).empty());
  EXPECT_TRUE(EncodeJpeg({cv::Mat(10, 10, CV_16UC1, cv::Scalar(1)), nullptr}, 90, 100000).empty());
}

}  // namespace
}  // namespace livemap
