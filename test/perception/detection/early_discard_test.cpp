#include "perception/detection/early_discard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "common/error.h"

namespace livemap::perception {
namespace {

const cv::Scalar kRedRoad(0, 0, 255);
const cv::Scalar kGreyRoad(90, 90, 90);

ModelManifest TinyScore() {
  return ReadModelManifest(LIVEMAP_SOURCE_DIR "/test/perception/inference/tiny_score.yaml");
}

/// Answers with one number, whatever the image.
class OneAnswer final : public InferenceEngine {
 public:
  explicit OneAnswer(float answer) : answer_(1, 1, answer) {}
  cv::Mat Run(const cv::Mat&) override { return answer_; }
  EngineKind Kind() const override { return EngineKind::kOpenCv; }

 private:
  cv::Mat_<float> answer_;
};

TEST(EarlyDiscard, OneBlockOfAHazardMakesAFrameWorthSending) {
  EarlyDiscard discard(TinyScore());
  cv::Mat image(96, 128, CV_8UC3, kGreyRoad);
  EXPECT_LT(discard.Score(image), 0.01F);
  image(cv::Rect(32, 16, 16, 16)) = kRedRoad;
  EXPECT_GT(discard.Score(image), 0.99F);
}

TEST(EarlyDiscard, ImagesOfAnySizeAreJudgedAlike) {
  EarlyDiscard discard(TinyScore());
  for (const cv::Size size : {cv::Size(64, 48), cv::Size(640, 400), cv::Size(48, 200)}) {
    EXPECT_GT(discard.Score(cv::Mat(size, CV_8UC3, kRedRoad)), 0.99F) << size;
    EXPECT_LT(discard.Score(cv::Mat(size, CV_8UC3, kGreyRoad)), 0.01F) << size;
  }
}

TEST(EarlyDiscard, TheThresholdIsTheManifests) {
  EXPECT_FLOAT_EQ(EarlyDiscard(TinyScore()).threshold(), 0.4F);
}

TEST(EarlyDiscard, AnImageThatItCannotUseIsRefusedAndTheNextOneWorks) {
  EarlyDiscard discard(TinyScore());
  EXPECT_THROW(discard.Score(cv::Mat()), Error);
  EXPECT_THROW(discard.Score(cv::Mat(48, 64, CV_8UC1, cv::Scalar(0))), Error);
  EXPECT_GT(discard.Score(cv::Mat(48, 64, CV_8UC3, kRedRoad)), 0.99F);
}

TEST(EarlyDiscard, AnAnswerThatIsNoProbabilityIsAnError) {
  for (const float answer : {std::numeric_limits<float>::quiet_NaN(), -0.1F, 1.1F}) {
    EarlyDiscard discard(TinyScore(), std::make_unique<OneAnswer>(answer));
    EXPECT_THROW(discard.Score(cv::Mat(48, 64, CV_8UC3, kGreyRoad)), Error) << answer;
  }
}

TEST(EarlyDiscard, ADetectorsModelIsRefusedInOneSentence) {
  try {
    EarlyDiscard discard(
        ReadModelManifest(LIVEMAP_SOURCE_DIR "/test/perception/inference/tiny.yaml"));
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("needs one class and a head of type 'score'"));
  }
}

}  // namespace
}  // namespace livemap::perception
