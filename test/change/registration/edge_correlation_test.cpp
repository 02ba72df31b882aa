#include "change/registration/edge_correlation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "change/registration/edge_registration.h"
#include "change/registration/registration.h"
#include "common/error.h"
#include "test/change/simulated_pairs.h"

namespace livemap::change {
namespace {

const std::vector<SimulatedPair>& PairsOfTwoDays() {
  static const std::vector<SimulatedPair> pairs = MakePairs({});
  return pairs;
}

Registration ByEdges(const cv::Mat& before, const cv::Mat& after) {
  return RegisterByEdges(before, after, RegistrationConfig());
}

/// The greatest distance between where two warps take the corners of the inner half of a picture.
double ApartPx(const cv::Matx33d& a, const cv::Matx33d& b, cv::Size size) {
  double most = 0;
  for (const double x : {0.25, 0.75}) {
    for (const double y : {0.25, 0.75}) {
      const cv::Vec3d corner(x * size.width, y * size.height, 1);
      const cv::Vec3d one = a * corner;
      const cv::Vec3d other = b * corner;
      most = std::max(most, std::hypot(one[0] / one[2] - other[0] / other[2],
                                       one[1] / one[2] - other[1] / other[2]));
    }
  }
  return most;
}

TEST(EdgeCorrelation, FindsAKnownScaleAndShiftToACell) {
  const cv::Mat& image = PairsOfTwoDays()[1].after.bgr;
  const double cell_px = image.cols / static_cast<double>(EdgeDetail::kCoarse);
  for (const cv::Matx33d& truth :
       {cv::Matx33d{1, 0, 0, 0, 1, 0, 0, 0, 1}, cv::Matx33d{1, 0, 21, 0, 1, -9, 0, 0, 1},
        cv::Matx33d{1.12, 0, -40, 0, 1.12, -20, 0, 0, 1},
        cv::Matx33d{0.87, 0, 30, 0, 0.87, 33, 0, 0, 1}}) {
    cv::Mat warped;
    cv::warpPerspective(image, warped, truth, image.size());
    const Registration found = ByEdges(image, warped);
    ASSERT_TRUE(found.accepted()) << found.why;
    EXPECT_LT(ApartPx(found.after_from_before, truth, image.size()), cell_px) << truth;
  }
}

TEST(EdgeCorrelation, FitsPicturesOfOnePlaceInEveryLight) {
  for (const simulation::Condition condition :
       {simulation::Condition::kDay, simulation::Condition::kDusk, simulation::Condition::kRain,
        simulation::Condition::kSnow}) {
    SimulatedPairOptions options;
    options.second = condition;
    int accepted = 0;
    for (const SimulatedPair& pair : MakePairs(options)) {
      const Registration found = ByEdges(pair.before.bgr, pair.after.bgr);
      std::printf("%s: evidence %.2f\n", simulation::ConditionName(condition), found.edge_evidence);
      accepted += found.accepted() ? 1 : 0;
    }
    EXPECT_GE(accepted, 3) << simulation::ConditionName(condition) << ", of 4";
  }
}

TEST(EdgeCorrelation, OtherPlacesAreRefused) {
  SimulatedPairOptions other;
  other.seed = 29;
  for (const SimulatedPair& there : MakePairs(other)) {
    for (const SimulatedPair& here : PairsOfTwoDays()) {
      const Registration found = ByEdges(there.before.bgr, here.after.bgr);
      EXPECT_EQ(found.refusal, RegistrationRefusal::kEdges) << found.edge_evidence;
      EXPECT_THAT(found.why, testing::HasSubstr("correlate by"));
    }
  }
}

TEST(EdgeCorrelation, APictureWithoutEdgesFitsNowhere) {
  const cv::Mat grey(384, 512, CV_8UC3, cv::Scalar::all(128));
  EXPECT_EQ(ByEdges(grey, PairsOfTwoDays()[0].after.bgr).refusal, RegistrationRefusal::kEdges);
  EXPECT_EQ(ByEdges(grey, grey).refusal, RegistrationRefusal::kEdges);
}

TEST(EdgeCorrelation, PicturesOfDifferentSizesAreRefused) {
  const cv::Mat& image = PairsOfTwoDays()[0].after.bgr;
  cv::Mat smaller;
  cv::resize(image, smaller, cv::Size(480, 360));
  EXPECT_EQ(ByEdges(smaller, image).refusal, RegistrationRefusal::kSize);
}

TEST(EdgeCorrelation, PicturesThatAreTooSmallOrTooLongAreRefused) {
  for (const cv::Size size : {cv::Size(64, 31), cv::Size(401, 100), cv::Size(100, 401)}) {
    const cv::Mat picture(size, CV_8UC3, cv::Scalar::all(90));
    const Registration found = ByEdges(picture, picture);
    EXPECT_EQ(found.refusal, RegistrationRefusal::kEdges) << size;
    EXPECT_THAT(found.why, testing::HasSubstr("32x32 and more")) << size;
  }
}

TEST(EdgeCorrelation, WhatIsNoPictureOfAStreetIsAMistake) {
  EXPECT_THROW(ExtractEdgeCells(cv::Mat(), EdgeDetail::kFine), Error);
  EXPECT_THROW(ExtractEdgeCells(cv::Mat(200, 300, CV_32FC1, cv::Scalar(0)), EdgeDetail::kFine),
               Error);
  EXPECT_THROW(ExtractEdgeCells(cv::Mat(31, 64, CV_8UC1, cv::Scalar(0)), EdgeDetail::kFine), Error);
  EXPECT_THROW(ExtractEdgeCells(cv::Mat(100, 401, CV_8UC1, cv::Scalar(0)), EdgeDetail::kFine),
               Error);
}

}  // namespace
}  // namespace livemap::change
