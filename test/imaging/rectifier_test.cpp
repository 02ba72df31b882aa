#include "imaging/rectifier.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "common/error.h"

namespace livemap::imaging {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

CameraCalibration Calibration(std::vector<double> distortion, const std::string& model) {
  CameraCalibration calibration;
  calibration.width = 640;
  calibration.height = 400;
  calibration.distortion_model = model;
  calibration.distortion = std::move(distortion);
  calibration.k = {420, 0, 310, 0, 425, 205, 0, 0, 1};
  calibration.p = {400, 0, 320, 0, 0, 400, 200, 0, 0, 0, 1, 0};
  return calibration;
}

/// A white disc of sub-pixel centre on black.
cv::Mat Disc(cv::Point2d centre) {
  cv::Mat image(400, 640, CV_8UC1, cv::Scalar(0));
  constexpr int kShift = 8;
  cv::circle(image, cv::Point(cvRound(centre.x * 256), cvRound(centre.y * 256)), 6 << kShift, 255,
             cv::FILLED, cv::LINE_AA, kShift);
  return image;
}

cv::Point2d Centroid(const cv::Mat& image) {
  const cv::Moments moments = cv::moments(image);
  return {moments.m10 / moments.m00, moments.m01 / moments.m00};
}

void ExpectMovesAsUndistortPoints(const CameraCalibration& calibration, bool fisheye) {
  const Rectifier rectifier(calibration, {});
  for (const cv::Point2d raw : {cv::Point2d(100.5, 80.25), {320, 200}, {540.75, 330}, {90, 320}}) {
    const std::vector<cv::Point2d> in = {raw};
    std::vector<cv::Point2d> out;
    const cv::Mat k(calibration.k);
    const cv::Mat p = cv::Mat(calibration.p).colRange(0, 3);
    if (fisheye) {
      cv::fisheye::undistortPoints(in, out, k, calibration.distortion, cv::noArray(), p);
    } else {
      cv::undistortPoints(in, out, k, calibration.distortion, cv::noArray(), p);
    }
    const cv::Point2d seen = Centroid(rectifier.Apply(Disc(raw)));
    EXPECT_NEAR(seen.x, out[0].x, 0.25) << raw;
    EXPECT_NEAR(seen.y, out[0].y, 0.25) << raw;
  }
}

TEST(Rectifier, MovesPointsAsUndistortPointsSays) {
  ExpectMovesAsUndistortPoints(Calibration({-0.28, 0.09, 0.001, -0.0008, 0}, "plumb_bob"), false);
}

TEST(Rectifier, MovesPointsOfAFisheyeLens) {
  ExpectMovesAsUndistortPoints(Calibration({-0.02, 0.004, -0.001, 0.0002}, "equidistant"), true);
}

TEST(Rectifier, LeavesAnUndistortedImageAlone) {
  CameraCalibration calibration = Calibration({0, 0, 0, 0, 0}, "plumb_bob");
  calibration.p = {420, 0, 310, 0, 0, 425, 205, 0, 0, 0, 1, 0};
  EXPECT_TRUE(Rectifier(calibration, {}).is_identity());
  EXPECT_TRUE(Rectifier(calibration, {640, 400}).is_identity());
  EXPECT_FALSE(Rectifier(calibration, {320, 200}).is_identity());
  calibration.p(0, 2) = 311;
  EXPECT_FALSE(Rectifier(calibration, {}).is_identity());
}

TEST(Rectifier, ResizesIntrinsicsAboutTheCornerOfTheFirstPixel) {
  CameraCalibration calibration = Calibration({}, "plumb_bob");
  calibration.k = {400, 0, 320, 0, 400, 200, 0, 0, 1};
  calibration.p(0, 3) = -40;
  const CameraCalibration half = Rectifier(calibration, {320, 0}).output();
  EXPECT_EQ(half.width, 320);
  EXPECT_EQ(half.height, 200);
  EXPECT_DOUBLE_EQ(half.k(0, 0), 200);
  EXPECT_DOUBLE_EQ(half.k(0, 2), 0.5 * 320.5 - 0.5);
  EXPECT_DOUBLE_EQ(half.k(1, 2), 0.5 * 200.5 - 0.5);
  EXPECT_DOUBLE_EQ(half.p(0, 3), -20);
}

TEST(Rectifier, ResizedImagesAgreeWithTheirIntrinsics) {
  CameraCalibration calibration = Calibration({}, "plumb_bob");
  calibration.k = {400, 0, 320, 0, 400, 200, 0, 0, 1};
  const cv::Point2d raw(431.5, 122.25);
  for (const OutputSize size : {OutputSize{320, 200}, OutputSize{960, 600}, OutputSize{500, 300}}) {
    const Rectifier rectifier(calibration, size);
    const cv::Matx33d& k = rectifier.output().k;
    const cv::Point2d seen = Centroid(rectifier.Apply(Disc(raw)));
    EXPECT_NEAR((seen.x - k(0, 2)) / k(0, 0), (raw.x - 320) / 400, 0.3 / 400);
    EXPECT_NEAR((seen.y - k(1, 2)) / k(1, 1), (raw.y - 200) / 400, 0.3 / 400);
  }
}

TEST(Rectifier, RefusesUnusableCalibrationsByName) {
  CameraCalibration nan = Calibration({}, "plumb_bob");
  nan.k(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT([&] { Rectifier(nan, {}); }, ThrowsMessage<Error>(HasSubstr("calibration's K")));
  CameraCalibration uncalibrated;
  uncalibrated.width = 640;
  uncalibrated.height = 400;
  EXPECT_THAT([&] { Rectifier(uncalibrated, {}); },
              ThrowsMessage<Error>(HasSubstr("positive focal lengths")));
  CameraCalibration huge = Calibration({}, "plumb_bob");
  huge.width = 1 << 30;
  EXPECT_THAT([&] { Rectifier(huge, {}); },
              ThrowsMessage<Error>(HasSubstr("image size is 1073741824x400")));
  EXPECT_THAT(
      [] {
        Rectifier(Calibration({1, 2, 3}, "plumb_bob"), {});
      },
      ThrowsMessage<Error>(HasSubstr("3 distortion coefficients")));
  EXPECT_THAT([] { Rectifier(Calibration({}, "wobbly"), {}); },
              ThrowsMessage<Error>(HasSubstr("'wobbly'")));
  EXPECT_THAT(
      [] {
        Rectifier(Calibration({}, "plumb_bob"), {-1, 0});
      },
      ThrowsMessage<Error>(HasSubstr("output size is -1x0")));
}

}  // namespace
}  // namespace livemap::imaging
