#include "odometry/edge/image_pyramid.h"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/core.hpp>

namespace livemap::odometry {
namespace {

TEST(Pyramid, HasThreeLevelsAtMostAndNoneBelowTheLeastSize) {
  EXPECT_EQ(CountLevels({640, 480}), 3);
  EXPECT_EQ(CountLevels({1280, 960}), 3);
  EXPECT_EQ(CountLevels({639, 480}), 2);
  EXPECT_EQ(CountLevels({1241, 376}), 2);
  EXPECT_EQ(CountLevels({320, 240}), 2);
  EXPECT_EQ(CountLevels({1, 1}), 1);
}

TEST(Pyramid, ACoarserCameraSeesThePointInTheSamePlaceOfTheScene) {
  const geo::CameraIntrinsics fine{500, 510, 319.5, 239.5, 640, 480};
  const geo::CameraIntrinsics coarse = HalvedIntrinsics(fine);
  // The centre of the coarse pixel (x, y) lies between the fine pixels 2x, 2x + 1 and 2y, 2y + 1.
  const double ray_x = (2 * 10 + 0.5 - fine.cx) / fine.fx;
  const double ray_y = (2 * 20 + 0.5 - fine.cy) / fine.fy;
  EXPECT_NEAR(coarse.fx * ray_x + coarse.cx, 10, 1e-12);
  EXPECT_NEAR(coarse.fy * ray_y + coarse.cy, 20, 1e-12);
}

TEST(DepthPyramid, UnitsBecomeMetresAndWhatIsNoDepthBecomesUnknown) {
  cv::Mat raw(4, 4, CV_16UC1, cv::Scalar(1500));
  raw.at<std::uint16_t>(0, 0) = 0;
  raw.at<std::uint16_t>(0, 1) = 65535;
  DepthPyramid pyramid;
  pyramid.Build(raw, 1000, {0.1F, 10.0F}, 1);
  EXPECT_FLOAT_EQ(pyramid[0].at<float>(3, 3), 1.5F);
  EXPECT_EQ(pyramid[0].at<float>(0, 0), 0);
  EXPECT_EQ(pyramid[0].at<float>(0, 1), 0) << "beyond the range";

  cv::Mat metres(4, 4, CV_32FC1, cv::Scalar(2));
  metres.at<float>(1, 1) = std::numeric_limits<float>::quiet_NaN();
  metres.at<float>(1, 2) = std::numeric_limits<float>::infinity();
  metres.at<float>(1, 3) = -1;
  pyramid.Build(metres, 1, {0.1F, 10.0F}, 1);
  EXPECT_EQ(pyramid[0].at<float>(0, 0), 2);
  for (const int x : {1, 2, 3}) EXPECT_EQ(pyramid[0].at<float>(1, x), 0) << x;
}

TEST(DepthPyramid, NeitherHolesNorWhatIsBehindAnEdgeIsBlendedIn) {
  const cv::Mat metres = (cv::Mat_<float>(2, 6) << 1.00F, 1.02F, 1.0F, 3.0F, 0, 0,  //
                          0.00F, 1.01F, 3.0F, 3.0F, 0, 0);
  DepthPyramid pyramid;
  pyramid.Build(metres, 1, {0.1F, 10.0F}, 2);
  EXPECT_NEAR(pyramid[1].at<float>(0, 0), 1.01F, 1e-6) << "the hole does not count";
  EXPECT_EQ(pyramid[1].at<float>(0, 1), 1.0F) << "the nearer surface alone";
  EXPECT_EQ(pyramid[1].at<float>(0, 2), 0) << "unknown stays unknown";
}

/// Variance of the central differences along the rows.
double VarianceOfDifferences(const cv::Mat& grey) {
  const cv::Rect right(2, 0, grey.cols - 2, grey.rows), left(0, 0, grey.cols - 2, grey.rows);
  cv::Mat differences, mean, deviation;
  cv::subtract(grey(right), grey(left), differences, cv::noArray(), CV_32F);
  cv::meanStdDev(0.5 * differences, mean, deviation);
  return deviation.at<double>(0) * deviation.at<double>(0);
}

TEST(ImagePyramid, NoiseOfTheGradientsIsThatOfABareWall) {
  cv::RNG random(5);
  for (const double sigma : {1.0, 4.0, 12.0}) {
    cv::Mat noise(480, 640, CV_16SC1), grey;
    random.fill(noise, cv::RNG::NORMAL, 120, sigma);
    noise.convertTo(grey, CV_8U);
    ImagePyramid images;
    images.Build(grey);
    images.MeasureNoise(grey);
    for (int level = 0; level < images.levels(); ++level) {
      const double there_is = VarianceOfDifferences(images[level]);
      EXPECT_NEAR(images.GradientNoise(level) / there_is, 1, 0.35) << sigma << ", level " << level;
    }
  }
}

TEST(ImagePyramid, StripesAndSlopesAreNoNoise) {
  cv::Mat grey(480, 640, CV_8UC1);
  for (int x = 0; x < grey.cols; ++x) grey.col(x).setTo(x / 8 % 2 == 0 ? 60 + x / 8 : 200 - x / 8);
  ImagePyramid images;
  images.Build(grey);
  images.MeasureNoise(grey);
  // Only the rounding to whole grey levels.
  EXPECT_LT(images.GradientNoise(0), 0.1);
}

}  // namespace
}  // namespace livemap::odometry
