#include "evaluation/detection/detection_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace livemap::evaluation {
namespace {

using ::testing::ElementsAre;

const cv::Rect2f kHere(0, 0, 10, 10);
const cv::Rect2f kNear(2, 0, 10, 10);   // IoU 80 / 120 = 0.667 with kHere
const cv::Rect2f kLoose(4, 0, 10, 10);  // IoU 60 / 140 = 0.429 with kHere
const cv::Rect2f kAway(100, 0, 10, 10);

ScoredFrame Frame(std::vector<cv::Rect2f> labels, std::vector<ScoredBox> detections,
                  double chainage_m = 0) {
  return {std::move(labels), std::move(detections), chainage_m, {}};
}

TEST(AveragePrecision, IsOneWhenEveryLabelIsFoundAndNothingElse) {
  EXPECT_DOUBLE_EQ(AveragePrecision({Frame({kHere}, {{kNear, 0.6F}}), Frame({}, {})}, 0.5), 1);
}

TEST(AveragePrecision, IsTheAreaUnderTheEnvelopeOverAllPoints) {
  // Descending: hit, miss, hit, miss, hit of 4 labels. Precision at the hits: 1, 2/3, 3/5.
  const std::vector<ScoredFrame> frames = {
      Frame({kHere}, {{kNear, 0.9F}, {kAway, 0.8F}}), Frame({kHere}, {{kHere, 0.7F}}),
      Frame({kHere}, {{kAway, 0.6F}, {kHere, 0.5F}}), Frame({kHere}, {})};
  EXPECT_DOUBLE_EQ(AveragePrecision(frames, 0.5), (1 + 2.0 / 3 + 3.0 / 5) / 4);
}

TEST(AveragePrecision, TheEnvelopeLiftsPrecisionThatRisesAgain) {
  // Descending: miss, hit, hit of 2 labels: precision 0, 1/2, 2/3, envelope 2/3 throughout.
  const std::vector<ScoredFrame> frames = {
      Frame({kHere, kAway}, {{{50, 50, 5, 5}, 0.9F}, {kHere, 0.8F}, {kAway, 0.7F}})};
  EXPECT_DOUBLE_EQ(AveragePrecision(frames, 0.5), 2.0 / 3);
}

TEST(AveragePrecision, ALabelIsMatchedOnceByTheMostConfident) {
  const std::vector<ScoredFrame> frames = {Frame({kHere, kAway}, {{kNear, 0.9F}, {kHere, 0.8F}})};
  EXPECT_DOUBLE_EQ(AveragePrecision(frames, 0.5), 0.5);
}

TEST(AveragePrecision, ADetectionTakesTheFreeLabelThatItOverlapsMost) {
  // The first overlaps both labels enough; it must leave the other one to the second.
  const cv::Rect2f other(3, 0, 10, 10);
  const std::vector<ScoredFrame> frames = {Frame({kHere, other}, {{other, 0.9F}, {kHere, 0.8F}})};
  EXPECT_DOUBLE_EQ(AveragePrecision(frames, 0.3), 1);
}

TEST(AveragePrecision, DependsOnTheOverlapAskedFor) {
  const std::vector<ScoredFrame> frames = {Frame({kHere}, {{kLoose, 0.9F}})};
  EXPECT_DOUBLE_EQ(AveragePrecision(frames, 0.5), 0);
  EXPECT_DOUBLE_EQ(AveragePrecision(frames, 0.3), 1);
}

TEST(AveragePrecision, IsZeroWithoutLabelsOrDetections) {
  EXPECT_DOUBLE_EQ(AveragePrecision({}, 0.5), 0);
  EXPECT_DOUBLE_EQ(AveragePrecision({Frame({}, {{kHere, 0.9F}})}, 0.5), 0);
  EXPECT_DOUBLE_EQ(AveragePrecision({Frame({kHere}, {})}, 0.5), 0);
}

TEST(CountMatches, CountsFromTheThresholdOnInclusive) {
  const std::vector<ScoredFrame> frames = {
      Frame({kHere}, {{kHere, 0.5F}, {kAway, 0.75F}, {kAway, 0.25F}}), Frame({kHere}, {})};
  const MatchCounts counts = CountMatches(frames, 0.5, 0.5);
  EXPECT_EQ(counts.labels, 2U);
  EXPECT_EQ(counts.detections, 2U);
  EXPECT_EQ(counts.matched, 1U);
  EXPECT_DOUBLE_EQ(counts.Precision().value(), 0.5);
  EXPECT_DOUBLE_EQ(counts.Recall().value(), 0.5);
}

TEST(CountMatches, RatiosOfNothingAreUndefined) {
  const MatchCounts counts = CountMatches({Frame({}, {})}, 0.5, 0.5);
  EXPECT_FALSE(counts.Precision().has_value());
  EXPECT_FALSE(counts.Recall().has_value());
}

TEST(Events, AreRunsOfLabelledFramesAtMostTwelveMetresApart) {
  const ScoredDrive drive = {Frame({kHere}, {}, 0),    Frame({}, {}, 5),  Frame({kHere}, {}, 12),
                             Frame({kHere}, {}, 24.1), Frame({}, {}, 30), Frame({kHere}, {}, 36.1)};
  EXPECT_THAT(FindEvents(drive), ElementsAre(ElementsAre(0, 2), ElementsAre(3, 5)));
}

TEST(Events, AreRecalledByOneDetectionInOneOfTheirFrames) {
  const ScoredDrive drive = {
      Frame({kHere}, {}, 0),
      Frame({kHere}, {{kNear, 0.6F}}, 5),     // recalled
      Frame({kHere}, {{kLoose, 0.9F}}, 100),  // only at IoU 0.3
      Frame({kHere}, {{kHere, 0.4F}}, 200),   // below the threshold
      Frame({}, {{kHere, 0.9F}}, 205),        // not a frame of the event
  };
  EXPECT_EQ(FindEvents(drive).size(), 3U);
  EXPECT_EQ(CountRecalledEvents(drive, 0.5, 0.5), 1U);
  EXPECT_EQ(CountRecalledEvents(drive, 0.5, 0.3), 2U);
  EXPECT_EQ(CountRecalledEvents(drive, 0.4, 0.5), 2U);
}

TEST(FalseReports, StartAnewMoreThanTwelveMetresAfterTheLastBegan) {
  ScoredDrive drive;
  for (const double chainage_m : {0.0, 5.0, 12.0, 12.5, 20.0, 24.5, 25.0}) {
    drive.push_back(Frame({}, {{kAway, 0.9F}}, chainage_m));
  }
  const FalseCounts counts = CountFalse(drive, 0.5, 0.5);
  EXPECT_EQ(counts.detections, 7U);
  EXPECT_EQ(counts.reports, 3U) << "at 0, 12.5 and 25 m";
}

TEST(FalseReports, AreNotMadeByDetectionsOfALabelOrBelowTheThreshold) {
  const ScoredDrive drive = {
      Frame({kHere}, {{kNear, 0.9F}, {kHere, 0.8F}}, 0),  // two on one label: neither is false
      Frame({kHere}, {{kLoose, 0.9F}}, 50),               // too little overlap: false
      Frame({}, {{kHere, 0.4F}}, 100)};
  const FalseCounts counts = CountFalse(drive, 0.5, 0.5);
  EXPECT_EQ(counts.detections, 1U);
  EXPECT_EQ(counts.reports, 1U);
}

TEST(DifficultObjects, NeedNotBeFoundAndAreNotWrong) {
  ScoredFrame frame = Frame({kHere}, {{kAway, 0.9F}, {kHere, 0.8F}}, 0);
  frame.difficult = {kAway};
  EXPECT_DOUBLE_EQ(AveragePrecision({frame}, 0.5), 1);
  EXPECT_EQ(CountMatches({frame}, 0.5, 0.5).detections, 1U);
  EXPECT_EQ(CountFalse({frame}, 0.5, 0.5).detections, 0U);
  frame.labels.clear();
  EXPECT_TRUE(FindEvents({frame}).empty());
}

TEST(DifficultObjects, ExcuseOnlyWhatLiesHalfInThem) {
  ScoredFrame frame = Frame({kHere}, {{{106, 0, 10, 10}, 0.9F}, {{104, 0, 10, 10}, 0.8F}}, 0);
  frame.difficult = {kAway};
  EXPECT_EQ(CountFalse({frame}, 0.5, 0.5).detections, 1U);
}

TEST(DifficultObjects, DoNotTakeDetectionsFromLabels) {
  ScoredFrame frame = Frame({kHere}, {{kHere, 0.9F}}, 0);
  frame.difficult = {kHere};
  EXPECT_DOUBLE_EQ(AveragePrecision({frame}, 0.5), 1);
}

TEST(DrivenKm, CountsALongGapAsTwelveMetres) {
  EXPECT_DOUBLE_EQ(
      DrivenKm({Frame({}, {}, 100), Frame({}, {}, 105), Frame({}, {}, 1000), Frame({}, {}, 1010)}),
      0.027);
  EXPECT_DOUBLE_EQ(DrivenKm({}), 0);
}

TEST(EvaluateClass, PoolsDrivesAndPhotosButTakesEventsFromDrives) {
  const std::vector<ScoredDrive> drives = {
      {Frame({kHere}, {{kHere, 0.9F}}, 0), Frame({}, {{kAway, 0.8F}}, 10)},
      {Frame({kHere}, {}, 0), Frame({}, {}, 10)}};
  const std::vector<ScoredFrame> photos = {Frame({kHere}, {{kHere, 0.7F}, {kAway, 0.6F}})};
  const ClassFigures figures = EvaluateClass(drives, photos, 0.5);
  EXPECT_EQ(figures.frames, 5U);
  EXPECT_EQ(figures.labels, 3U);
  EXPECT_DOUBLE_EQ(figures.ap50.value_or(-1), (1 + 2.0 / 3) / 3);
  EXPECT_DOUBLE_EQ(figures.precision.value(), 0.5);
  EXPECT_DOUBLE_EQ(figures.recall.value(), 2.0 / 3);
  EXPECT_EQ(figures.events, 2U);
  EXPECT_DOUBLE_EQ(figures.event_recall.value(), 0.5);
  EXPECT_EQ(figures.false_reports, 1U);
  EXPECT_DOUBLE_EQ(figures.km, 0.02);
  EXPECT_DOUBLE_EQ(figures.false_per_km.value(), 50);
}

TEST(EvaluateClass, WithoutDrivesEventAndRoadFiguresAreUndefined) {
  const ClassFigures figures = EvaluateClass({}, {Frame({kHere}, {{kAway, 0.9F}})}, 0.5);
  EXPECT_FALSE(figures.event_recall.has_value());
  EXPECT_FALSE(figures.event_recall_iou30.has_value());
  EXPECT_FALSE(figures.false_per_km.has_value());
}

TEST(SweepThresholds, GivesTheFiguresOfEachThreshold) {
  const std::vector<ScoredDrive> drives = {
      {Frame({kHere}, {{kHere, 0.6F}}, 0), Frame({}, {{kAway, 0.3F}}, 10)}};
  const std::vector<ClassFigures> sweep = SweepThresholds(drives, {}, {0.2, 0.5, 0.8});
  ASSERT_EQ(sweep.size(), 3U);
  EXPECT_EQ(sweep[0].false_reports, 1U);
  EXPECT_EQ(sweep[1].false_reports, 0U);
  EXPECT_DOUBLE_EQ(sweep[1].event_recall.value(), 1);
  EXPECT_DOUBLE_EQ(sweep[2].event_recall.value(), 0);
}

}  // namespace
}  // namespace livemap::evaluation
