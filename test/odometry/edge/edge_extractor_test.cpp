#include "odometry/edge/edge_extractor.h"

#include <gmock/gmock.h>

#include <opencv2/imgproc.hpp>

#include "common/error.h"
#include "odometry/edge/canny_detector.h"

namespace livemap::odometry {
namespace {

/// Discs and bars with soft and hard edges, and noise.
cv::Mat Scene(int seed) {
  cv::RNG random(static_cast<std::uint64_t>(seed));
  cv::Mat image(240, 320, CV_8UC1, cv::Scalar(110));
  for (int i = 0; i < 12; ++i) {
    cv::circle(image, {random.uniform(0, 320), random.uniform(0, 240)}, random.uniform(5, 40),
               cv::Scalar(random.uniform(0, 255)), -1);
    cv::line(image, {random.uniform(0, 320), random.uniform(0, 240)},
             {random.uniform(0, 320), random.uniform(0, 240)}, cv::Scalar(random.uniform(0, 255)),
             3);
  }
  cv::GaussianBlur(image, image, {5, 5}, 0);
  cv::Mat noise(image.size(), CV_8UC1);
  random.fill(noise, cv::RNG::UNIFORM, 0, 6);
  return image + noise;
}

double ShareOf(const cv::Mat& mask) {
  return static_cast<double>(cv::countNonZero(mask)) / static_cast<double>(mask.total());
}

TEST(CannyDetector, FindsWhatOpenCvFindsWithTheSameThresholds) {
  for (int seed = 1; seed <= 5; ++seed) {
    const cv::Mat image = Scene(seed);
    cv::Mat expected;
    cv::Canny(image, expected, 80, 200, 3, false);
    CannyDetector canny;
    cv::Mat difference;
    cv::absdiff(canny.ExtractAbove(image, 80, 200), expected, difference);
    // The directions differ by 0.4 degrees at their borders.
    EXPECT_LT(cv::countNonZero(difference), 0.04 * cv::countNonZero(expected)) << seed;
    EXPECT_GT(cv::countNonZero(expected), 1000);
  }
}

TEST(CannyDetector, ThresholdFollowsTheContrast) {
  const cv::Mat image = Scene(3);
  CannyDetector canny;
  const double bright = ShareOf(canny.Extract(image, 0.08, 0.5));
  cv::Mat dim;
  image.convertTo(dim, CV_8U, 0.4, 20);
  const double dark = ShareOf(canny.Extract(dim, 0.08, 0.5));
  EXPECT_NEAR(dark, bright, 0.25 * bright);
}

TEST(EdgeExtractor, AnEvenImageHasNoEdges) {
  for (const EdgeKind kind : {EdgeKind::kCanny, EdgeKind::kLaplacianOfGaussian, EdgeKind::kSobel}) {
    EdgeExtractor::Config config;
    config.kind = kind;
    EdgeExtractor extractor(config);
    for (const int level : {0, 128, 255}) {
      const cv::Mat even(120, 160, CV_8UC1, cv::Scalar(level));
      EXPECT_EQ(cv::countNonZero(extractor.Extract(even)), 0) << EdgeKindName(kind) << level;
    }
  }
}

TEST(EdgeExtractor, EveryKindFindsTheStepAndNothingElse) {
  cv::Mat step(120, 160, CV_8UC1, cv::Scalar(60));
  step.colRange(80, 160).setTo(180);
  for (const EdgeKind kind : {EdgeKind::kCanny, EdgeKind::kLaplacianOfGaussian, EdgeKind::kSobel}) {
    EdgeExtractor::Config config;
    config.kind = kind;
    EdgeExtractor extractor(config);
    const cv::Mat edges = extractor.Extract(step);
    EXPECT_GE(cv::countNonZero(edges.colRange(78, 82)), 110) << EdgeKindName(kind);
    EXPECT_EQ(cv::countNonZero(edges.colRange(0, 77)), 0) << EdgeKindName(kind);
    EXPECT_EQ(cv::countNonZero(edges.colRange(83, 160)), 0) << EdgeKindName(kind);
  }
}

TEST(EdgeExtractor, SmallestImagesAreWorkedOff) {
  for (const EdgeKind kind : {EdgeKind::kCanny, EdgeKind::kLaplacianOfGaussian, EdgeKind::kSobel}) {
    EdgeExtractor::Config config;
    config.kind = kind;
    EdgeExtractor extractor(config);
    EXPECT_EQ(extractor.Extract(cv::Mat(1, 1, CV_8UC1, cv::Scalar(9))).total(), 1U);
    EXPECT_EQ(extractor.Extract(cv::Mat(3, 5, CV_8UC1, cv::Scalar(9))).total(), 15U);
  }
}

TEST(EdgeExtractor, StructuredEdgesWithoutTheirModelAreAClearError) {
  EdgeExtractor::Config config;
  config.kind = EdgeKind::kStructured;
  EXPECT_THAT([&] { EdgeExtractor{config}; },
              ::testing::ThrowsMessage<Error>(::testing::HasSubstr("structured_model")));
  config.structured_model = "/nowhere/model.yml.gz";
  EXPECT_THAT([&] { EdgeExtractor{config}; },
              ::testing::ThrowsMessage<Error>(::testing::HasSubstr("/nowhere/model.yml.gz")));
}

TEST(EdgeKindTest, AnUnknownNameIsRefusedWithTheAcceptedOnes) {
  EXPECT_EQ(ParseEdgeKind("log"), EdgeKind::kLaplacianOfGaussian);
  EXPECT_THAT([] { ParseEdgeKind("prewitt"); },
              ::testing::ThrowsMessage<Error>(::testing::HasSubstr("canny, log, sobel")));
}

}  // namespace
}  // namespace livemap::odometry
