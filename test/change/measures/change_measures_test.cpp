#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "change/measures/binary_counts.h"
#include "change/measures/change_pairs.h"
#include "change/measures/change_report.h"
#include "change/measures/community_change_scores.h"
#include "change/measures/pooled_change_scores.h"
#include "change/measures/score_histogram.h"
#include "change/registration/change_region.h"
#include "common/error.h"

namespace livemap::change {
namespace {

/// A prediction without classes from scores of change, row by row.
ChangeProbabilities Scores(int rows, int columns, const std::vector<float>& values) {
  ChangeProbabilities probabilities;
  const cv::Mat change = cv::Mat(values, true).reshape(1, rows);
  probabilities.of_class.resize(2);
  cv::subtract(1.0, change, probabilities.of_class[0]);
  probabilities.of_class[1] = change.colRange(0, columns).clone();
  return probabilities;
}

cv::Mat Mask(int rows, const std::vector<std::uint8_t>& values) {
  return cv::Mat(values, true).reshape(1, rows);
}

/// One row of pixels: each pixel's class probabilities, the rest on no change.
ChangeProbabilities Classes(
    const std::vector<std::vector<std::pair<protocol::ChangeClass, float>>>& pixels) {
  ChangeProbabilities probabilities;
  for (int i = 0; i < protocol::kChangeClasses; ++i) {
    probabilities.of_class.emplace_back(1, static_cast<int>(pixels.size()), CV_32FC1,
                                        cv::Scalar(i == 0 ? 1 : 0));
  }
  for (std::size_t column = 0; column < pixels.size(); ++column) {
    for (const auto& [change_class, share] : pixels[column]) {
      const int x = static_cast<int>(column);
      probabilities.of_class[static_cast<std::size_t>(change_class)].at<float>(0, x) = share;
      probabilities.of_class[0].at<float>(0, x) -= share;
    }
  }
  return probabilities;
}

TEST(ScoreHistogram, FindsTheThresholdOfAFalsePositiveRate) {
  // Ten negatives at 0.05, 0.15, ..., 0.95; four positives.
  ScoreHistogram scores;
  for (int i = 0; i < 10; ++i) scores.Add(0.05F + 0.1F * static_cast<float>(i), false);
  for (const float score : {0.99F, 0.90F, 0.80F, 0.10F}) scores.Add(score, true);
  const auto at_tenth = scores.AtFalsePositiveRate(0.10);
  ASSERT_TRUE(at_tenth);
  // One negative (0.95) may pass; the next is at 0.85: 0.99 and 0.90 are found.
  EXPECT_EQ(at_tenth->counts.false_positive, 1U);
  EXPECT_EQ(at_tenth->counts.true_positive, 2U);
  EXPECT_EQ(at_tenth->counts.false_negative, 2U);
  EXPECT_EQ(at_tenth->counts.true_negative, 9U);
  EXPECT_NEAR(at_tenth->threshold, 0.85, 1e-4);
  EXPECT_DOUBLE_EQ(*at_tenth->counts.precision(), 2.0 / 3);
  EXPECT_DOUBLE_EQ(*at_tenth->counts.recall(), 0.5);
  EXPECT_DOUBLE_EQ(*at_tenth->counts.f1(), 4.0 / 7);
  const auto at_hundredth = scores.AtFalsePositiveRate(0.01);
  EXPECT_EQ(at_hundredth->counts.false_positive, 0U);
  EXPECT_EQ(at_hundredth->counts.true_positive, 1U);
  EXPECT_EQ(scores.AtFalsePositiveRate(1.0)->counts.true_positive, 4U);
}

TEST(ScoreHistogram, InventsNothingBetweenEqualScores) {
  ScoreHistogram scores;
  for (int i = 0; i < 5; ++i) scores.Add(1.0F, false);
  for (int i = 0; i < 5; ++i) scores.Add(1.0F, true);
  const auto operation = scores.AtFalsePositiveRate(0.10);
  EXPECT_EQ(operation->counts.true_positive, 0U);
  EXPECT_EQ(operation->counts.false_positive, 0U);
  EXPECT_GT(operation->threshold, 1.0);
  EXPECT_FALSE(operation->counts.precision());
  EXPECT_DOUBLE_EQ(*scores.RocArea(), 0.5);
  EXPECT_DOUBLE_EQ(*scores.AveragePrecision(), 0.5);
}

TEST(ScoreHistogram, CountsAtAGivenThreshold) {
  ScoreHistogram scores;
  scores.Add(0.8F, true);
  scores.Add(0.3F, true);
  scores.Add(0.5F, false);
  const BinaryCounts counts = scores.AtThreshold(0.5);
  EXPECT_EQ(counts.true_positive, 1U);
  EXPECT_EQ(counts.false_negative, 1U);
  EXPECT_EQ(counts.false_positive, 1U);
  EXPECT_EQ(scores.AtThreshold(1.0).false_positive, 0U);
}

TEST(ChangeRegion, OfTheRoadIsATrapezoidBelowTheHorizon) {
  const cv::Mat road = ChangeRegionMask("road", {100, 100});
  const auto at = [&road](int x, int y) { return int{road.at<std::uint8_t>(y, x)}; };
  EXPECT_EQ(at(50, 40), 0) << "above the horizon";
  EXPECT_EQ(at(50, 45), 255);
  EXPECT_EQ(at(20, 45), 0) << "beside the road";
  EXPECT_EQ(at(1, 85), 255);
  EXPECT_EQ(cv::countNonZero(ChangeRegionMask("all", {8, 4})), 32);
  EXPECT_THROW(ChangeRegionMask("sky", {8, 4}), Error);
}

TEST(ScoreHistogram, AreasAreThoseCountedByHand) {
  ScoreHistogram scores;
  // From the top: + - + - ; pairs in order: (1st+ above both -) 2, (2nd+ above one -) 1 of 4.
  scores.Add(0.9F, true);
  scores.Add(0.7F, false);
  scores.Add(0.5F, true);
  scores.Add(0.3F, false);
  EXPECT_DOUBLE_EQ(*scores.RocArea(), 0.75);
  EXPECT_DOUBLE_EQ(*scores.AveragePrecision(), 0.5 * 1 + 0.5 * 2 / 3);
  const auto curve = scores.Curve(100);
  ASSERT_EQ(curve.size(), 4U);
  EXPECT_DOUBLE_EQ(curve[1].false_positive_rate, 0.5);
  EXPECT_DOUBLE_EQ(curve[1].recall, 0.5);
  EXPECT_DOUBLE_EQ(*curve[2].precision, 2.0 / 3);
  EXPECT_DOUBLE_EQ(curve.back().recall, 1.0);
}

TEST(ScoreHistogram, AnEmptyOneHasNoFigures) {
  const ScoreHistogram scores;
  EXPECT_FALSE(scores.AtFalsePositiveRate(0.1));
  EXPECT_FALSE(scores.RocArea());
  EXPECT_FALSE(scores.AveragePrecision());
  EXPECT_TRUE(scores.Curve(10).empty());
}

TEST(ScoreHistogram, ThinsACurveAndKeepsItsEnd) {
  ScoreHistogram scores;
  for (int i = 0; i < 20000; ++i) {
    scores.Add(static_cast<float>(i) / 20000, i % 2 == 0);
  }
  const auto curve = scores.Curve(50);
  EXPECT_LE(curve.size(), 60U);
  EXPECT_GE(curve.size(), 40U);
  EXPECT_DOUBLE_EQ(curve.back().recall, 1);
  EXPECT_DOUBLE_EQ(curve.back().false_positive_rate, 1);
}

TEST(PooledChangeScores, CountsPixelsOfAllPairsAndLeavesOutWhatNobodyKnows) {
  PooledChangeScores pooled;
  pooled.Add(Scores(2, 2, {0.9F, 0.2F, 0.6F, 0.1F}), Mask(2, {1, 0, 0, kLeftOutPixel}), true);
  pooled.Add(Scores(1, 2, {0.3F, 0.4F}), Mask(1, {7, 0}), true);
  EXPECT_EQ(pooled.pixels(), 5U);
  EXPECT_EQ(pooled.left_out(), 1U);
  const BinaryCounts& counts = pooled.at_most_likely();
  EXPECT_EQ(counts.true_positive, 1U);
  EXPECT_EQ(counts.false_positive, 1U);
  EXPECT_EQ(counts.false_negative, 1U);
  EXPECT_EQ(counts.true_negative, 2U);
  EXPECT_DOUBLE_EQ(*counts.accuracy(), 0.6);
  EXPECT_FALSE(pooled.tells_classes());
  EXPECT_FALSE(pooled.MultiClassAccuracy());
}

TEST(PooledChangeScores, MultiClassAccuracyIsAmongChangesThatWereFound) {
  using C = protocol::ChangeClass;
  PooledChangeScores pooled;
  // Truth: sign found as sign; sign found as bin; sign missed; nothing taken for a vehicle; bin
  // found as bin.
  pooled.Add(Classes({{{C::kSign, 0.8F}},
                      {{C::kBin, 0.5F}, {C::kSign, 0.4F}},
                      {{C::kSign, 0.3F}},
                      {{C::kVehicle, 0.9F}},
                      {{C::kBin, 0.7F}}}),
             Mask(1, {7, 7, 7, 0, 2}), true);
  ASSERT_TRUE(pooled.tells_classes());
  EXPECT_DOUBLE_EQ(*pooled.MultiClassAccuracy(), 2.0 / 3);
  EXPECT_EQ(pooled.confusion()[7][2], 1U);
  EXPECT_EQ(pooled.confusion()[0][9], 1U);
  // The sign's own curve, from the top: 0.8 +, 0.4 +, 0.3 +, then the rest at 0.
  EXPECT_DOUBLE_EQ(*pooled.of_class(C::kSign).AveragePrecision(), 1.0);
  EXPECT_EQ(pooled.of_class(C::kSign).positives(), 3U);
  // A change is a change whatever its class.
  EXPECT_EQ(pooled.at_most_likely().true_positive, 3U);
}

TEST(PooledChangeScores, RefusesAMaskOfAnotherSize) {
  PooledChangeScores pooled;
  EXPECT_THROW(pooled.Add(Scores(1, 2, {0, 0}), Mask(2, {0, 0}), true), Error);
}

TEST(CommunityChangeScores, TakesTheMeanOverPairsAndThePool) {
  CommunityChangeScores community;
  // The left half changed. Found whole; found in its upper half.
  const cv::Rect left(0, 0, 64, 128);
  const cv::Rect upper_left(0, 0, 64, 64);
  cv::Mat truth = cv::Mat::zeros(128, 128, CV_8UC1);
  truth(left).setTo(3);
  const auto found = [](const cv::Rect& where) {
    cv::Mat change = cv::Mat::zeros(128, 128, CV_32FC1);
    change(where).setTo(1);
    ChangeProbabilities probabilities;
    probabilities.of_class = {1 - change, change};
    return probabilities;
  };
  community.Add("whole", found(left), truth);
  community.Add("half", found(upper_left), truth);
  community.Add("nothing there, nothing said", found({}), cv::Mat::zeros(128, 128, CV_8UC1));
  ASSERT_EQ(community.pairs().size(), 3U);
  const BinaryCounts& whole = community.pairs()[0].second;
  EXPECT_EQ(whole.true_positive, 512U * 256U);
  EXPECT_EQ(whole.total(), 512U * 512U);
  EXPECT_NEAR(*community.pairs()[1].second.f1(), 2.0 / 3, 0.01);
  EXPECT_NEAR(*community.MeanF1(), (1 + 2.0 / 3 + 0) / 3, 0.01);
  EXPECT_NEAR(*community.MeanF1WithChange(), (1 + 2.0 / 3) / 2, 0.01);
  EXPECT_NEAR(*community.Pooled().f1(), 2.0 * 1.5 / (2 * 1.5 + 0.5), 0.01);
}

TEST(ChangeProbabilitiesCheck, RefusesWhatIsNoProbability) {
  EXPECT_NO_THROW(CheckProbabilities(Scores(1, 2, {0, 1}), {2, 1}, "p"));
  EXPECT_THROW(CheckProbabilities(Scores(1, 2, {0, 1}), {1, 2}, "p"), Error);
  EXPECT_THROW(CheckProbabilities(Scores(1, 2, {0, 1.5F}), {2, 1}, "p"), Error);
  EXPECT_THROW(CheckProbabilities(Scores(1, 2, {0, std::nanf("")}), {2, 1}, "p"), Error);
  ChangeProbabilities three = Scores(1, 2, {0, 1});
  three.of_class.push_back(three.of_class[0]);
  try {
    CheckProbabilities(three, {2, 1}, "p.npy");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                testing::AllOf(testing::HasSubstr("p.npy"), testing::HasSubstr("3 classes")));
  }
}

TEST(ChangeReport, HasTheKeysThatTheDocumentPromises) {
  ChangeReport report;
  report.method = "dense-sift";
  report.registration = "none";
  using C = protocol::ChangeClass;
  report.forward.pooled.Add(Classes({{{C::kSign, 0.8F}}, {}}), Mask(1, {7, 0}), true);
  report.forward.community.Add("000/00", Classes({{{C::kSign, 0.8F}}, {}}), Mask(1, {7, 0}));
  auto json = ToJson(report, 0);
  std::vector<std::string> keys;
  for (const auto& [key, value] : json.items()) keys.push_back(key);
  EXPECT_THAT(
      keys, testing::ElementsAre("method", "directories", "registration", "region", "pairs",
                                 "refused_pairs", "left_out_pairs", "unknown_colour_pixels",
                                 "method_ms_p50", "registration_ms_p50", "pixels", "change_pixels",
                                 "left_out_pixels", "at_fpr", "roc_area", "ap", "argmax",
                                 "multi_class_accuracy", "classes", "confusion", "community",
                                 "compared", "unseen", "on_board", "directions", "reversed"));
  EXPECT_TRUE(json["compared"].is_null());
  EXPECT_EQ(json["at_fpr"]["0.01"]["f1"], 1.0);
  EXPECT_EQ(json["at_fpr"]["0.01"]["f1_at_full_recall"], 1.0);
  EXPECT_EQ(json["multi_class_accuracy"], 1.0);
  EXPECT_EQ(json["classes"]["sign"]["ap"], 1.0);
  EXPECT_TRUE(json["classes"]["bin"]["ap"].is_null());
  EXPECT_TRUE(json["reversed"].is_null());
  json = ToJson(report, 10);
  EXPECT_EQ(json["pair_figures"][0]["name"], "000/00");
  EXPECT_EQ(json["curve"]["recall"].back(), 1.0);
  EXPECT_THAT(ToText(report), testing::HasSubstr("multi-class accuracy  1.0000"));
}

TEST(ChangeReport, TellsWhatWasComparedApartFromWhatWasGuessed) {
  ChangeReport report;
  const ChangeProbabilities scores = Scores(1, 4, {0.9F, 0.2F, 0.6F, 0.8F});
  report.forward.pooled.Add(scores, Mask(1, {1, 0, 0, 1}), false);
  report.compared.emplace();
  report.compared->Add(scores, Mask(1, {1, 0, 0, kLeftOutPixel}), false);
  report.unseen.emplace();
  report.unseen->Add(scores, Mask(1, {kLeftOutPixel, kLeftOutPixel, kLeftOutPixel, 1}), false);
  report.on_board_threshold = 0.5;
  const auto json = ToJson(report, 0);
  EXPECT_EQ(json["compared"]["pixels"], 3);
  EXPECT_EQ(json["compared"]["at_fpr"]["0.01"]["f1"], 1.0);
  EXPECT_EQ(json["unseen"]["change_pixels"], 1);
  EXPECT_TRUE(json["unseen"]["at_fpr"]["0.01"].is_null()) << "nothing there is unchanged";
  EXPECT_EQ(json["on_board"]["precision"], 0.5);
  EXPECT_EQ(json["on_board"]["recall"], 1.0);
  EXPECT_THAT(ToText(report), testing::HasSubstr("shown by no earlier picture"));
}

TEST(ChangeReport, OfMasksThatLeaveEverythingOutIsNullWithAReason) {
  ChangeReport report;
  const ChangeProbabilities certain = Scores(1, 2, {0, 0});
  report.forward.pooled.Add(certain, Mask(1, {kLeftOutPixel, kLeftOutPixel}), false);
  report.forward.community.Add("000/00", certain, Mask(1, {kLeftOutPixel, kLeftOutPixel}));
  const auto json = ToJson(report, 0);
  EXPECT_EQ(json["reason"], "the masks of all 1 pairs leave out every pixel");
  for (const char* key : {"roc_area", "ap", "method_ms_p50", "registration_ms_p50"}) {
    EXPECT_TRUE(json[key].is_null()) << key;
  }
  for (const auto& [key, value] : json["argmax"].items()) EXPECT_TRUE(value.is_null()) << key;
}

TEST(CountDirections, LeavesOutWhatIsNoChangeInTruthOrSeveralThings) {
  cv::Mat classes = cv::Mat::zeros(20, 60, CV_8UC1);
  cv::Mat truth = classes.clone();
  std::vector<ChangeRegion> regions;
  const auto add = [&](int column, ChangeDirection direction, int appeared, int vanished) {
    ChangeRegion region;
    region.box = cv::Rect(column, 5, 10, 10);
    region.direction = direction;
    classes(region.box).setTo(7);
    truth(cv::Rect(column, 5, 10, appeared)).setTo(protocol::kAppearedPixel);
    truth(cv::Rect(column, 5 + appeared, 10, vanished)).setTo(protocol::kVanishedPixel);
    regions.push_back(region);
  };
  add(0, ChangeDirection::kAppeared, 8, 1);
  add(10, ChangeDirection::kAppeared, 0, 5);
  add(20, ChangeDirection::kUnknown, 0, 5);
  add(30, ChangeDirection::kVanished, 3, 0);
  add(40, ChangeDirection::kVanished, 5, 5);
  add(50, ChangeDirection::kVanished, 0, 10);
  DirectionCounts counts;
  CountDirections(regions, classes, truth, counts);
  EXPECT_EQ(counts.right, 2U);
  EXPECT_EQ(counts.wrong, 1U);
  EXPECT_EQ(counts.unknown, 1U);
}

}  // namespace
}  // namespace livemap::change
