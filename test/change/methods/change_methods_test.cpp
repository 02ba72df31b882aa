#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "change/methods/change_method.h"
#include "change/methods/daisy.h"
#include "common/error.h"

namespace livemap::change {
namespace {

/// Smooth noise: texture everywhere.
cv::Mat Texture(int seed, cv::Size size = {160, 120}) {
  cv::Mat image(size, CV_8UC3);
  cv::RNG random(static_cast<std::uint64_t>(seed));
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(image, image, cv::Size(), 2);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

cv::Mat AllValid(const cv::Mat& image) { return {image.size(), CV_8UC1, cv::Scalar(255)}; }

double MeanOf(const cv::Mat& image, const cv::Rect& part) { return cv::mean(image(part))[0]; }

class ClassicalMethod : public testing::TestWithParam<const char*> {};

TEST_P(ClassicalMethod, ScoresWhatWasReplacedHigherThanWhatStayed) {
  const cv::Mat before = Texture(1);
  cv::Mat after = before.clone();
  const cv::Rect replaced(60, 40, 40, 40);
  Texture(2)(replaced).copyTo(after(replaced));
  const auto method = MakeChangeMethod(GetParam());
  const auto probabilities = method->Run({before, after, AllValid(before)});
  ASSERT_EQ(probabilities.of_class.size(), 2U);
  EXPECT_FALSE(method->tells_classes());
  CheckProbabilities(probabilities, after.size(), GetParam());
  const cv::Mat& change = probabilities.of_class[1];
  EXPECT_GT(MeanOf(change, {70, 50, 20, 20}), 0.2);
  EXPECT_LT(MeanOf(change, {0, 0, 30, 120}), 0.02);
}

TEST_P(ClassicalMethod, ABrighterPictureOfTheSameIsNoChange) {
  const cv::Mat before = Texture(3);
  cv::Mat after;
  before.convertTo(after, -1, 0.6, 30);
  const auto probabilities = MakeChangeMethod(GetParam())->Run({before, after, AllValid(before)});
  EXPECT_LT(cv::mean(probabilities.of_class[1])[0], 0.06);
}

TEST_P(ClassicalMethod, NothingIsSaidWhereTheEarlierPictureIsNotKnown) {
  const cv::Mat before = Texture(4);
  const cv::Mat after = Texture(5);
  cv::Mat valid = AllValid(before);
  valid.colRange(0, 80).setTo(0);
  const auto probabilities = MakeChangeMethod(GetParam())->Run({before, after, valid});
  EXPECT_EQ(cv::countNonZero(probabilities.of_class[1].colRange(0, 80)), 0);
  EXPECT_EQ(MeanOf(probabilities.of_class[0], {0, 0, 80, 120}), 1.0);
  EXPECT_GT(MeanOf(probabilities.of_class[1], {90, 10, 60, 100}), 0.2);
}

TEST_P(ClassicalMethod, RefusesPicturesOfDifferentSizes) {
  const cv::Mat before = Texture(1);
  const cv::Mat after = Texture(1, {158, 120});
  const auto method = MakeChangeMethod(GetParam());
  EXPECT_THROW(method->Run({before, after, AllValid(after)}), Error);
  EXPECT_THROW(method->Run({before, before, AllValid(after)}), Error);
  EXPECT_THROW(method->Run({cv::Mat(), cv::Mat(), cv::Mat()}), Error);
}

TEST_P(ClassicalMethod, FlatPicturesDoNotDiffer) {
  const cv::Mat grey(50, 70, CV_8UC3, cv::Scalar::all(90));
  const cv::Mat lighter(50, 70, CV_8UC3, cv::Scalar::all(200));
  const auto probabilities = MakeChangeMethod(GetParam())->Run({grey, lighter, AllValid(grey)});
  EXPECT_EQ(cv::countNonZero(probabilities.of_class[1]), 0);
}

INSTANTIATE_TEST_SUITE_P(Methods, ClassicalMethod, testing::Values("dense-sift", "daisy"),
                         [](const auto& method) {
                           return std::string(method.param) == "daisy" ? "Daisy" : "DenseSift";
                         });

TEST(ChangeMethods, UnknownOnesAreNamed) {
  EXPECT_THROW(MakeChangeMethod("best"), Error);
  for (const std::string& name : ChangeMethodNames()) EXPECT_NE(MakeChangeMethod(name), nullptr);
}

TEST(ChangeMethods, TheDifferenceIsTheMeanOfTheChannels) {
  const cv::Mat before(2, 3, CV_8UC3, cv::Scalar(10, 20, 30));
  const cv::Mat after(2, 3, CV_8UC3, cv::Scalar(40, 20, 90));
  const ChangeProbabilities found =
      MakeChangeMethod("difference")->Run({before, after, cv::Mat(2, 3, CV_8UC1, cv::Scalar(255))});
  EXPECT_NEAR(found.of_class[1].at<float>(1, 2), 30.0 / 255, 1e-5);
  EXPECT_NEAR(found.of_class[0].at<float>(1, 2), 1 - 30.0 / 255, 1e-5);
}

TEST(Daisy, ARampPointsOneWayInEveryHistogram) {
  cv::Mat ramp(80, 80, CV_8UC1);
  for (int row = 0; row < 80; ++row) {
    for (int column = 0; column < 80; ++column) {
      ramp.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(3 * column);
    }
  }
  const Daisy daisy(ramp);
  ASSERT_EQ(daisy.size(), (3 * 8 + 1) * 8);
  std::vector<float> descriptor(200);
  daisy.Describe(40, 40, descriptor.data());
  for (std::size_t histogram = 0; histogram < 25; ++histogram) {
    const float* bins = &descriptor[8 * histogram];
    double square = 0;
    for (int i = 0; i < 8; ++i)
      square += static_cast<double>(bins[i]) * static_cast<double>(bins[i]);
    EXPECT_NEAR(square, 1, 1e-5);
    // Grey rises to the right: bin 0, and its two neighbours by cos 45 degrees.
    EXPECT_NEAR(bins[0], 1 / std::sqrt(2.0), 1e-3);
    EXPECT_NEAR(bins[1], 0.5, 1e-3);
    EXPECT_NEAR(bins[7], 0.5, 1e-3);
    for (int i = 2; i <= 6; ++i) EXPECT_NEAR(bins[i], 0, 1e-3);
  }
}

TEST(MaskUnobserved, MakesNoChangeCertainThereAndLeavesTheRest) {
  const cv::Size size(4, 2);
  cv::Mat valid(size, CV_8UC1, cv::Scalar(255));
  valid.at<uchar>(1, 3) = 0;
  for (const bool tells_classes : {true, false}) {
    ChangeProbabilities probabilities = NothingChanged(size, tells_classes);
    probabilities.of_class[0].setTo(0.25);
    probabilities.of_class[1].setTo(0.75);
    MaskUnobserved(valid, probabilities);
    EXPECT_EQ(probabilities.of_class[0].at<float>(1, 3), 1);
    EXPECT_EQ(probabilities.of_class[1].at<float>(1, 3), 0);
    EXPECT_EQ(probabilities.of_class[0].at<float>(0, 3), 0.25F);
    EXPECT_EQ(probabilities.of_class[1].at<float>(0, 3), 0.75F);
  }
}

}  // namespace
}  // namespace livemap::change
