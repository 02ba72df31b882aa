#include "perception/detection/yolox_decoder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "common/error.h"
#include "test/perception/detection/synthetic_head.h"

namespace livemap::perception {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
const cv::Size kPicture(128, 96);  // twice the input
constexpr double kScale = 0.5;

void SetRow(cv::Mat& predictions, int row, const std::vector<float>& values) {
  std::copy(values.begin(), values.end(), predictions.ptr<float>(0, row));
}

HazardDetection Candidate(int class_index, float confidence, cv::Rect2f box) {
  return {class_index == 0 ? "pothole" : "traffic_cone", class_index, confidence, box};
}

TEST(YoloxDecoder, ABoxOfEachLevelLandsWhereItsCellSays) {
  const ModelManifest manifest = TwoLevelManifest();
  cv::Mat predictions = NothingSeen(manifest);
  // Stride 8, column 3, row 2: centre ((0.5 + 3) * 8, (0.25 + 2) * 8) = (28, 18), size 16 x 8.
  SetRow(predictions, 2 * 8 + 3, {0.5F, 0.25F, std::log(2.0F), 0, 0.9F, 1.0F, 0});
  // Stride 16, column 1, row 2: centre ((0 + 1) * 16, (0.5 + 2) * 16) = (16, 40), size 8 x 16.
  SetRow(predictions, 48 + 2 * 4 + 1, {0, 0.5F, std::log(0.5F), 0, 1.0F, 0, 0.85F});
  const std::vector<HazardDetection> found = DecodeYolox(predictions, manifest, kScale, kPicture);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].class_name, "pothole");
  EXPECT_EQ(found[0].class_index, 0);
  EXPECT_FLOAT_EQ(found[0].confidence, 0.9F);
  EXPECT_FLOAT_EQ(found[0].box.x, 2 * (28 - 8));
  EXPECT_FLOAT_EQ(found[0].box.y, 2 * (18 - 4));
  EXPECT_FLOAT_EQ(found[0].box.width, 32);
  EXPECT_FLOAT_EQ(found[0].box.height, 16);
  EXPECT_EQ(found[1].class_name, "traffic_cone");
  EXPECT_FLOAT_EQ(found[1].confidence, 0.85F);
  EXPECT_FLOAT_EQ(found[1].box.x, 2 * (16 - 4));
  EXPECT_FLOAT_EQ(found[1].box.y, 2 * (40 - 8));
  EXPECT_FLOAT_EQ(found[1].box.width, 16);
  EXPECT_FLOAT_EQ(found[1].box.height, 32);
}

TEST(YoloxDecoder, EachClassHasItsOwnThresholdOnObjectnessTimesClassScore) {
  const ModelManifest manifest = TwoLevelManifest();  // pothole 0.5, traffic cone 0.8
  cv::Mat predictions = NothingSeen(manifest);
  SetRow(predictions, 0, {0.5F, 0.5F, 0, 0, 0.75F, 0.75F, 1.0F});  // 0.5625 and 0.75
  SetRow(predictions, 20, {0.5F, 0.5F, 0, 0, 0.75F, 0.5F, 0});     // 0.375
  const std::vector<HazardDetection> found = DecodeYolox(predictions, manifest, kScale, kPicture);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].class_name, "pothole");
  EXPECT_FLOAT_EQ(found[0].confidence, 0.5625F);
}

TEST(YoloxDecoder, ViewsAreFusedAndTheirMeanIsHeldAgainstTheThreshold) {
  ModelManifest manifest = TwoLevelManifest();  // pothole 0.5; one level each: strides 8 and 16
  manifest.head.views = 2;
  cv::Mat predictions = NothingSeen(manifest);
  // 16 x 16 px around (24, 24) of the input in both views, and one around (8, 8) in the first
  // alone.
  SetRow(predictions, 3 * 8 + 3, {0, 0, std::log(2.0F), std::log(2.0F), 0.8F, 1, 0});
  SetRow(predictions, 48 + 4 + 1, {0.5F, 0.5F, 0, 0, 0.3F, 1, 0});
  SetRow(predictions, 8 + 1, {0, 0, std::log(2.0F), std::log(2.0F), 0.95F, 1, 0});
  const std::vector<HazardDetection> found = DecodeYolox(predictions, manifest, kScale, kPicture);
  ASSERT_EQ(found.size(), 1U) << "0.95 / 2 is below the threshold";
  EXPECT_FLOAT_EQ(found[0].confidence, 0.55F);
  EXPECT_FLOAT_EQ(found[0].box.x, 2 * 16);
  EXPECT_FLOAT_EQ(found[0].box.width, 32);
}

TEST(YoloxDecoder, TheRowsOfTheFirstViewAloneAreHeldAgainstTheThresholdAsTheyAre) {
  ModelManifest manifest = TwoLevelManifest();  // pothole 0.5; one level each: 48 and 12 rows
  manifest.head.views = 2;
  cv::Mat both = NothingSeen(manifest);
  SetRow(both, 8 + 1, {0, 0, std::log(2.0F), std::log(2.0F), 0.95F, 1, 0});
  SetRow(both, 3 * 8 + 3, {0, 0, 0, 0, 0.4F, 1, 0});
  const int first[] = {1, 48, 7};
  const cv::Mat predictions(3, first, CV_32F, both.data);
  const std::vector<HazardDetection> found = DecodeYolox(predictions, manifest, kScale, kPicture);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_FLOAT_EQ(found[0].confidence, 0.95F);
}

TEST(YoloxDecoder, BoxesAreCutToTheImage) {
  const ModelManifest manifest = TwoLevelManifest();
  cv::Mat predictions = NothingSeen(manifest);
  SetRow(predictions, 0, {0, 0, std::log(100.0F), std::log(2.0F), 1, 1, 0});
  SetRow(predictions, 47, {0.5F, 0.5F, 200, 200, 0.9F, 0, 1});  // exp(200) overflows a float
  const std::vector<HazardDetection> found = DecodeYolox(predictions, manifest, kScale, kPicture);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].box, cv::Rect2f(0, 0, 128, 16));
  EXPECT_EQ(found[1].box, cv::Rect2f(0, 0, 128, 96));
}

TEST(YoloxDecoder, BoxesOutsideTheImageAreDropped) {
  const ModelManifest manifest = TwoLevelManifest();
  cv::Mat predictions = NothingSeen(manifest);
  SetRow(predictions, 0, {-5, 0.5F, 0, 0, 1, 1, 0});
  SetRow(predictions, 1, {0.5F, 100, 0, 0, 1, 1, 0});
  SetRow(predictions, 2, {0.5F, 0.5F, -300, 0, 1, 1, 0});  // exp(-300) is nothing
  EXPECT_TRUE(DecodeYolox(predictions, manifest, kScale, kPicture).empty());
}

TEST(YoloxDecoder, NumbersThatAreNotFiniteOrNoScoresAreDropped) {
  const ModelManifest manifest = TwoLevelManifest();
  cv::Mat predictions = NothingSeen(manifest);
  int row = 0;
  for (const float bad : {kNan, kInfinity, -kInfinity}) {
    for (std::size_t column = 0; column < 6; ++column) {
      std::vector<float> values = {0.5F, 0.5F, 0, 0, 1, 1, 0};
      values[column] = bad;
      SetRow(predictions, row++, values);
    }
  }
  SetRow(predictions, row++, {0.5F, 0.5F, 0, 0, -1, -0.9F, 0});
  SetRow(predictions, row++, {0.5F, 0.5F, 0, 0, 2, 0.5F, 0});
  SetRow(predictions, row++, {0.5F, 0.5F, 0, 0, 0.5F, 2, 0});
  EXPECT_TRUE(DecodeYolox(predictions, manifest, kScale, kPicture).empty());
}

TEST(YoloxDecoder, AnotherShapeIsRefused) {
  const ModelManifest manifest = TwoLevelManifest();
  const int too_few_rows[] = {1, 59, 7};
  const int too_few_columns[] = {1, 60, 6};
  const int flat[] = {60, 7};
  for (const cv::Mat& predictions : {cv::Mat(3, too_few_rows, CV_32F, cv::Scalar(0)),
                                     cv::Mat(3, too_few_columns, CV_32F, cv::Scalar(0)),
                                     cv::Mat(2, flat, CV_32F, cv::Scalar(0)), cv::Mat()}) {
    EXPECT_THROW(DecodeYolox(predictions, manifest, kScale, kPicture), Error);
  }
}

TEST(Suppression, TheWeakerOfTwoOverlappingBoxesOfAClassGoes) {
  const std::vector<HazardDetection> kept = SuppressOverlaps(
      {Candidate(0, 0.6F, {0, 0, 10, 10}), Candidate(0, 0.9F, {1, 0, 10, 10})}, 0.5F);
  ASSERT_EQ(kept.size(), 1U);
  EXPECT_FLOAT_EQ(kept[0].confidence, 0.9F);
}

TEST(Suppression, BoxesOfOtherClassesAndFarBoxesStayInDescendingConfidence) {
  const std::vector<HazardDetection> kept =
      SuppressOverlaps({Candidate(0, 0.6F, {0, 0, 10, 10}), Candidate(1, 0.9F, {0, 0, 10, 10}),
                        Candidate(0, 0.7F, {50, 0, 10, 10})},
                       0.5F);
  ASSERT_EQ(kept.size(), 3U);
  EXPECT_FLOAT_EQ(kept[0].confidence, 0.9F);
  EXPECT_FLOAT_EQ(kept[1].confidence, 0.7F);
  EXPECT_FLOAT_EQ(kept[2].confidence, 0.6F);
}

TEST(Suppression, ASuppressedBoxSuppressesNoOther) {
  // A chain: the first overlaps the second, the second the third, the first not the third.
  const std::vector<HazardDetection> kept =
      SuppressOverlaps({Candidate(0, 0.9F, {0, 0, 10, 10}), Candidate(0, 0.8F, {3, 0, 10, 10}),
                        Candidate(0, 0.7F, {6, 0, 10, 10})},
                       0.5F);
  ASSERT_EQ(kept.size(), 2U);
  EXPECT_FLOAT_EQ(kept[1].box.x, 6);
}

TEST(Suppression, OnlyTheMostConfidentCandidatesAreLookedAt) {
  std::vector<HazardDetection> candidates;
  for (std::size_t i = 0; i < kMaxCandidates + 10; ++i) {
    const auto x = static_cast<float>(i);
    candidates.push_back(Candidate(0, 0.5F + 1e-5F * x, {20 * x, 0, 10, 10}));
  }
  const std::vector<HazardDetection> kept = SuppressOverlaps(candidates, 0.5F);
  ASSERT_EQ(kept.size(), kMaxCandidates);
  EXPECT_FLOAT_EQ(kept.front().box.x, 20.0F * (kMaxCandidates + 9));
}

/// Suppression as it is defined, every candidate against every kept one.
std::vector<HazardDetection> SuppressedByTheBook(std::vector<HazardDetection> candidates,
                                                 float iou_limit) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.confidence > b.confidence; });
  std::vector<HazardDetection> kept;
  for (const HazardDetection& candidate : candidates) {
    if (std::none_of(kept.begin(), kept.end(), [&](const HazardDetection& better) {
          return better.class_index == candidate.class_index &&
                 IntersectionOverUnion(better.box, candidate.box) > iou_limit;
        })) {
      kept.push_back(candidate);
    }
  }
  return kept;
}

/// Boxes of many sizes, bunched and spread, cut to 640 x 400 as a decoder cuts them.
std::vector<HazardDetection> RandomCandidates(std::mt19937& random, int count) {
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<HazardDetection> candidates;
  for (int i = 0; i < count; ++i) {
    const float around = unit(random) < 0.5F ? 30.0F : 640.0F;
    const float width = std::exp(6 * unit(random));
    const float height = unit(random) < 0.5F ? width : std::exp(6 * unit(random));
    cv::Rect2f box(200 + around * (unit(random) - 0.5F), 150 + around * (unit(random) - 0.5F),
                   width, height);
    box &= cv::Rect2f(0, 0, 640, 400);
    // Few levels of confidence, so that there are equal ones.
    const float confidence = std::floor(50 * unit(random)) / 50;
    if (!box.empty()) candidates.push_back(Candidate(unit(random) < 0.7F ? 0 : 1, confidence, box));
  }
  return candidates;
}

TEST(Suppression, KeepsWhatComparingAllWithAllKeeps) {
  std::mt19937 random(1);
  for (const float limit : {0.0F, 0.1F, 0.3F, 0.5F, 0.65F, 0.9F, 1.0F}) {
    for (const int count : {0, 1, 7, 100, 1500}) {
      const std::vector<HazardDetection> candidates = RandomCandidates(random, count);
      const std::vector<HazardDetection> expected = SuppressedByTheBook(candidates, limit);
      const std::vector<HazardDetection> kept = SuppressOverlaps(candidates, limit);
      ASSERT_EQ(kept.size(), expected.size()) << count << " candidates at " << limit;
      for (std::size_t i = 0; i < kept.size(); ++i) {
        EXPECT_EQ(kept[i].box, expected[i].box);
        EXPECT_EQ(kept[i].class_index, expected[i].class_index);
        EXPECT_EQ(kept[i].confidence, expected[i].confidence);
      }
    }
  }
}

TEST(IntersectionOverUnion, OfKnownBoxes) {
  EXPECT_DOUBLE_EQ(IntersectionOverUnion({0, 0, 10, 10}, {0, 0, 10, 10}), 1);
  EXPECT_DOUBLE_EQ(IntersectionOverUnion({0, 0, 10, 10}, {5, 0, 10, 10}), 50.0 / 150);
  EXPECT_DOUBLE_EQ(IntersectionOverUnion({0, 0, 10, 10}, {10, 0, 10, 10}), 0);
  EXPECT_DOUBLE_EQ(IntersectionOverUnion({0, 0, 0, 0}, {0, 0, 0, 0}), 0);
}

}  // namespace
}  // namespace livemap::perception
