#include "imaging/stereo_depth.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "common/error.h"

namespace livemap::imaging {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kFocalPx = 300;
constexpr double kBaselineM = 0.4;

/// Rectified; `x_m` is the camera's place to the right of the left camera.
CameraCalibration Camera(double x_m, double cx = 160) {
  CameraCalibration camera;
  camera.width = 320;
  camera.height = 240;
  camera.k = {kFocalPx, 0, cx, 0, kFocalPx, 100, 0, 0, 1};
  camera.p = {kFocalPx, 0, cx, -kFocalPx * x_m, 0, kFocalPx, 100, 0, 0, 0, 1, 0};
  return camera;
}

/// Where a ray from (x_m, 0, 0) through a pixel meets the plane normal * P = distance_m.
struct Plane {
  cv::Vec3d normal;
  double distance_m;

  double Depth(const CameraCalibration& camera, double u, double v) const {
    const double x_m = -camera.p(0, 3) / kFocalPx;
    const cv::Vec3d ray((u - camera.p(0, 2)) / kFocalPx, (v - camera.p(1, 2)) / kFocalPx, 1);
    return (distance_m - normal[0] * x_m) / normal.dot(ray);
  }
};

/// Smooth noise on the plane, a wave of it some pixels wide in the picture.
double Texture(double x_m, double y_m, const cv::Mat& noise) {
  const double u = x_m * 25 + 4000;
  const double v = y_m * 25 + 4000;
  const int side = noise.cols;
  const auto at = [&](double i, double j) {
    return noise.at<double>(static_cast<int>(j) % side, static_cast<int>(i) % side);
  };
  const double fu = u - std::floor(u);
  const double fv = v - std::floor(v);
  return (1 - fv) * ((1 - fu) * at(u, v) + fu * at(u + 1, v)) +
         fv * ((1 - fu) * at(u, v + 1) + fu * at(u + 1, v + 1));
}

/// What the camera sees of the plane, which is textured in its x and in y + z.
cv::Mat Look(const CameraCalibration& camera, const Plane& plane) {
  cv::Mat noise(512, 512, CV_64FC1);
  cv::RNG(3).fill(noise, cv::RNG::UNIFORM, 20, 235);
  cv::Mat image(camera.height, camera.width, CV_8UC1);
  const double x_m = -camera.p(0, 3) / kFocalPx;
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const double z = plane.Depth(camera, u, v);
      const double x = x_m + (u - camera.p(0, 2)) / kFocalPx * z;
      const double y = (v - camera.p(1, 2)) / kFocalPx * z;
      image.at<std::uint8_t>(v, u) = cv::saturate_cast<std::uint8_t>(Texture(x, y + z, noise));
    }
  }
  return image;
}

/// Of the shift between the cameras, pixels of the camera.
struct Errors {
  double found_share = 0;  ///< Of the pixels that the right camera sees too.
  double median_px = 0;
  double p95_px = 0;
};

Errors Compare(const cv::Mat& depth, const CameraCalibration& left, const Plane& plane) {
  constexpr int kMargin = 8;
  std::vector<double> errors;
  int seen = 0;
  for (int v = kMargin; v < depth.rows - kMargin; ++v) {
    for (int u = kMargin; u < depth.cols - kMargin; ++u) {
      const double shift_px = kFocalPx * kBaselineM / plane.Depth(left, u, v);
      if (u - shift_px < kMargin) continue;
      ++seen;
      const double found = depth.at<float>(v, u);
      if (std::isnan(found)) continue;
      errors.push_back(std::abs(kFocalPx * kBaselineM / found - shift_px));
    }
  }
  std::sort(errors.begin(), errors.end());
  if (errors.empty()) return {};
  return {static_cast<double>(errors.size()) / seen, errors[errors.size() / 2],
          errors[errors.size() * 95 / 100]};
}

/// Disparity 15 px.
const Plane kWall{{0, 0, 1}, 8};
/// From 5 m at the right end to 14 m at the left one: slanted sideways.
const Plane kHouseFront{{0.7, 0, 0.714}, 6};
/// A road 1.5 m below, rising so that it fills the picture.
const Plane kRamp{{0, 0.85, 0.527}, 5};

Errors ErrorsOn(const Plane& plane, int scale) {
  StereoConfig config;
  config.scale = scale;
  StereoDepth stereo(config, Camera(0), Camera(kBaselineM));
  const cv::Mat depth = stereo.Compute(Look(Camera(0), plane), Look(Camera(kBaselineM), plane));
  EXPECT_EQ(depth.type(), CV_32FC1);
  EXPECT_EQ(depth.size(), cv::Size(320, 240));
  return Compare(depth, Camera(0), plane);
}

TEST(StereoDepth, OfPlanesIsWithinHalfAPixelOfTheMatchedImages) {
  for (const int scale : {1, 2}) {
    for (const Plane& plane : {kWall, kHouseFront, kRamp}) {
      const Errors errors = ErrorsOn(plane, scale);
      EXPECT_GT(errors.found_share, 0.85) << plane.normal << ", scale " << scale;
      EXPECT_LT(errors.median_px, 0.25 * scale) << plane.normal << ", scale " << scale;
      EXPECT_LT(errors.p95_px, 0.5 * scale) << plane.normal << ", scale " << scale;
    }
  }
}

TEST(StereoDepth, OfAWallEightMetresAwayIsEightMetres) {
  StereoConfig config;
  config.scale = 1;
  StereoDepth stereo(config, Camera(0), Camera(kBaselineM));
  cv::Mat depth = stereo.Compute(Look(Camera(0), kWall), Look(Camera(kBaselineM), kWall));
  std::vector<float> known;
  std::copy_if(depth.begin<float>(), depth.end<float>(), std::back_inserter(known),
               [](float metres) { return !std::isnan(metres); });
  ASSERT_GT(known.size(), depth.total() / 2);
  std::nth_element(known.begin(), known.begin() + static_cast<int>(known.size() / 2), known.end());
  EXPECT_NEAR(known[known.size() / 2], 8, 0.1);
}

TEST(StereoDepth, KnowsPrincipalPointsThatDiffer) {
  for (const double right_cx : {150.0, 171.0}) {
    StereoDepth stereo({}, Camera(0), Camera(kBaselineM, right_cx));
    EXPECT_EQ(stereo.geometry().offset_px, 160 - right_cx);
    const cv::Mat depth =
        stereo.Compute(Look(Camera(0), kWall), Look(Camera(kBaselineM, right_cx), kWall));
    const Errors errors = Compare(depth, Camera(0), kWall);
    EXPECT_GT(errors.found_share, 0.85) << right_cx;
    EXPECT_LT(errors.p95_px, 1) << right_cx;
  }
}

TEST(StereoDepth, TakesColourAsItsGreyValues) {
  const cv::Mat left = Look(Camera(0), kRamp);
  const cv::Mat right = Look(Camera(kBaselineM), kRamp);
  cv::Mat left_colour, right_colour;
  cv::cvtColor(left, left_colour, cv::COLOR_GRAY2BGR);
  cv::cvtColor(right, right_colour, cv::COLOR_GRAY2BGR);
  StereoDepth stereo({}, Camera(0), Camera(kBaselineM));
  const cv::Mat of_grey = stereo.Compute(left, right);
  const cv::Mat of_colour = stereo.Compute(left_colour, right_colour);
  EXPECT_TRUE(
      std::equal(of_grey.begin<float>(), of_grey.end<float>(), of_colour.begin<float>(),
                 [](float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); }));
}

TEST(StereoDepth, IsUnknownWithoutTexture) {
  StereoDepth stereo({}, Camera(0), Camera(kBaselineM));
  const cv::Mat flat(240, 320, CV_8UC1, cv::Scalar(90));
  const cv::Mat depth = stereo.Compute(flat, flat);
  EXPECT_EQ(cv::countNonZero(depth == depth), 0);
}

TEST(StereoDepth, IsThatOfRectifiedAndResizedImages) {
  // The right camera is turned inwards by 3 degrees and looks through a lens that bends.
  CameraCalibration raw = Camera(kBaselineM);
  raw.distortion_model = "plumb_bob";
  raw.distortion = {-0.1, 0.01, 0, 0, 0};
  const double turn = 3 * CV_PI / 180;
  raw.r = {std::cos(turn), 0, std::sin(turn), 0, 1, 0, -std::sin(turn), 0, std::cos(turn)};
  const OutputSize half{160, 0};
  const Rectifier left(Camera(0), half);
  const Rectifier right(raw, half);
  StereoConfig config;
  config.scale = 1;
  StereoDepth stereo(config, left.output(), right.output());
  EXPECT_NEAR(stereo.geometry().baseline_m, kBaselineM, 1e-9);
  EXPECT_NEAR(stereo.geometry().focal_px, kFocalPx / 2, 1e-9);

  // What the raw right camera sees: each raw pixel's ray, undistorted and turned into the pair's
  // axes.
  const cv::Mat ideal = Look(Camera(kBaselineM), kWall);
  cv::Mat raw_points(raw.height * raw.width, 1, CV_64FC2);
  for (int i = 0; i < raw_points.rows; ++i) {
    const int column = i % raw.width, row = i / raw.width;
    raw_points.at<cv::Vec2d>(i) = cv::Vec2d(column, row);
  }
  cv::Mat ideal_points;
  cv::undistortPoints(raw_points, ideal_points, raw.k, raw.distortion, raw.r,
                      raw.p.get_minor<3, 3>(0, 0));
  ideal_points = ideal_points.reshape(2, raw.height);
  ideal_points.convertTo(ideal_points, CV_32FC2);
  cv::Mat seen;
  cv::remap(ideal, seen, ideal_points, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);

  const cv::Mat depth = stereo.Compute(left.Apply(Look(Camera(0), kWall)), right.Apply(seen));
  ASSERT_EQ(depth.size(), cv::Size(160, 120));
  const cv::Rect middle(40, 20, 90, 80);
  cv::Mat known = depth(middle) == depth(middle);
  EXPECT_GT(cv::countNonZero(known), 0.8 * middle.area());
  EXPECT_NEAR(cv::mean(depth(middle), known)[0], 8, 0.3);
}

TEST(StereoGeometry, RefusesWhatIsNoPair) {
  const auto refused = [](const CameraCalibration& right, const std::string& sentence) {
    EXPECT_THAT([&] { MakeStereoGeometry(Camera(0), right); },
                ThrowsMessage<Error>(HasSubstr(sentence)));
  };
  refused(Camera(0), "accepted is -fx times the baseline");
  refused(Camera(-0.4), "accepted is -fx times the baseline");
  refused(Camera(std::numeric_limits<double>::quiet_NaN()), "accepted is -fx times the baseline");
  refused(Camera(0.4, 400), "less than half the image's width");
  CameraCalibration other = Camera(0.4);
  other.width = 640;
  refused(other, "the left image is 320x240 and the right one 640x240");
  other = Camera(0.4);
  other.p(0, 0) = 310;
  refused(other, "the focal lengths in P are 300 and 310");
  other = Camera(0.4);
  other.p(1, 2) = 103;
  refused(other, "the rows in P are 100 and 103");
  other = Camera(0.4);
  other.p = cv::Matx34d::zeros();
  refused(other, "the focal lengths in P are 300 and 0");
}

TEST(StereoDepth, RefusesParametersAndImagesThatItCannotUse) {
  const auto refused = [](const StereoConfig& config, const std::string& sentence) {
    EXPECT_THAT([&] { StereoDepth(config, Camera(0), Camera(0.4)); },
                ThrowsMessage<Error>(HasSubstr(sentence)));
  };
  StereoConfig config;
  config.min_depth_m = 0.1;
  refused(config,
          "stereo's least depth is 0.1 m, a search over 1200 pixels; accepted with these "
          "cameras is at least 0.75 m");
  config.min_depth_m = std::numeric_limits<double>::quiet_NaN();
  refused(config, "stereo's least depth is nan");
  config = {};
  config.block_size = 4;
  refused(config, "stereo's block size is 4, accepted is an odd number");
  config = {};
  config.scale = 3;
  refused(config, "stereo's scale is 3, accepted is 1, 2 or 4");
  config = {};
  config.min_disparity_px = 0;
  refused(config, "stereo's least disparity is 0");
  config = {};
  config.uniqueness_percent = 101;
  refused(config, "stereo's uniqueness is 101");

  StereoDepth stereo({}, Camera(0), Camera(0.4));
  const cv::Mat good(240, 320, CV_8UC1, cv::Scalar(0));
  EXPECT_THAT([&] { stereo.Compute(good, cv::Mat(240, 300, CV_8UC1)); },
              ThrowsMessage<Error>(HasSubstr("the right image is 300x240 of 1 channels, accepted "
                                             "is 320x240")));
  EXPECT_THROW(stereo.Compute(cv::Mat(240, 320, CV_16UC1), good), Error);
  EXPECT_THROW(stereo.Compute(cv::Mat(), good), Error);
}

}  // namespace
}  // namespace livemap::imaging
