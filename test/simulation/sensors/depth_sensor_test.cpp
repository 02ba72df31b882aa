#include "simulation/sensors/depth_sensor.h"

#include <gtest/gtest.h>

#include <cmath>

namespace livemap::simulation {
namespace {

constexpr geo::CameraIntrinsics kCamera{500, 500, 159.5, 119.5, 320, 240};

/// Mean and standard deviation over the right half of a plane.
std::pair<double, double> Spread(DepthSensor sensor, double metres) {
  const cv::Mat plane(240, 320, CV_32FC1, cv::Scalar(metres));
  const cv::Mat sensed = SenseDepth(plane, kCamera, sensor, 0.25, 7);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(sensed.colRange(200, 310), mean, deviation);
  return {mean[0], deviation[0]};
}

TEST(DepthSensor, ErrorsGrowWithTheSquareOfDistance) {
  const auto [near_mean, near_spread] = Spread(DepthSensor::kStereo, 5);
  const auto [far_mean, far_spread] = Spread(DepthSensor::kStereo, 20);
  EXPECT_NEAR(near_mean, 5, 0.01);
  EXPECT_NEAR(far_mean, 20, 0.05);
  // z^2 / (f b) times 0.12 pixels.
  EXPECT_NEAR(near_spread, 25 / 125.0 * 0.12, 0.002);
  EXPECT_NEAR(far_spread / near_spread, 16, 1);
}

TEST(DepthSensor, KinectSeesNothingBeyondItsRange) {
  EXPECT_NEAR(Spread(DepthSensor::kKinect, 3).first, 3, 0.02);
  EXPECT_EQ(Spread(DepthSensor::kKinect, 12).first, 0);
}

TEST(DepthSensor, StereoIsBlindBesideWhatHidesTheGround) {
  cv::Mat depth(240, 320, CV_32FC1, cv::Scalar(20));
  depth.colRange(150, 200) = 4;
  const cv::Mat sensed = SenseDepth(depth, kCamera, DepthSensor::kStereo, 0.25, 7);
  // Disparities are 31.25 and 6.25 pixels: left of the pole 25 pixels are hidden from the other
  // eye.
  EXPECT_EQ(sensed.at<float>(100, 135), 0);
  EXPECT_GT(sensed.at<float>(100, 118), 19);
  EXPECT_GT(sensed.at<float>(100, 230), 19);
  EXPECT_NEAR(sensed.at<float>(100, 175), 4, 0.1);
}

TEST(DepthSensor, ARoughOneLetsEdgesBleedAndLeavesPatchesOut) {
  cv::Mat depth(240, 320, CV_32FC1, cv::Scalar(4));
  depth.colRange(150, 200) = 2;
  const cv::Mat sensed = SenseDepth(depth, kCamera, DepthSensor::kRough, 0, 7);
  int bled = 0;
  for (int row = 0; row < 240; ++row) bled += std::abs(sensed.at<float>(row, 148) - 2) < 0.2F;
  EXPECT_GT(bled, 5) << "two pixels beside the near thing";
  EXPECT_LT(bled, 200);
  const double holes = 1 - cv::countNonZero(sensed.colRange(210, 310)) / (240 * 100.0);
  EXPECT_GT(holes, 0.01);
  EXPECT_LT(holes, 0.3);
}

TEST(DepthSensor, ExactDepthStaysAsItIs) {
  const cv::Mat depth(24, 32, CV_32FC1, cv::Scalar(7.5));
  EXPECT_EQ(SenseDepth(depth, kCamera, DepthSensor::kExact, 0.25, 7).data, depth.data);
  EXPECT_FALSE(ParseDepthSensor("laser"));
}

}  // namespace
}  // namespace livemap::simulation
