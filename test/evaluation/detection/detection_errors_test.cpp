#include "evaluation/detection/detection_errors.h"

#include <gtest/gtest.h>

namespace livemap::evaluation {
namespace {

const cv::Rect2f kThing(0, 0, 10, 10);
const cv::Rect2f kShifted(5, 0, 10, 10);  // IoU 1 / 3 with kThing
const cv::Rect2f kElsewhere(100, 0, 10, 10);

ScoredFrame SeenAt(double chainage_m, std::vector<cv::Rect2f> labels,
                   std::vector<ScoredBox> detections) {
  return {std::move(labels), std::move(detections), chainage_m, {}};
}

TEST(MissedEvents, SayWhatTheDetectorDidInstead) {
  const ScoredDrive drive = {SeenAt(0, {kThing}, {{kThing, 0.6F}}),
                             SeenAt(50, {kThing}, {{kShifted, 0.7F}, {kThing, 0.3F}}),
                             SeenAt(100, {kThing}, {{kShifted, 0.4F}, {kThing, 0.3F}}),
                             SeenAt(150, {kThing}, {{kShifted, 0.4F}, {kElsewhere, 0.9F}})};
  const std::vector<MissedEvent> missed = FindMissedEvents(drive, 0.5);
  ASSERT_EQ(missed.size(), 3U) << "the first event is recalled";
  EXPECT_EQ(missed[0].cause, MissCause::kMisplaced);
  EXPECT_FLOAT_EQ(missed[0].score, 0.7F);
  EXPECT_EQ(missed[1].cause, MissCause::kUnsure);
  EXPECT_FLOAT_EQ(missed[1].score, 0.3F);
  EXPECT_EQ(missed[2].cause, MissCause::kUnseen) << "weak and misplaced";
}

TEST(MissedEvents, AreShownWhereTheirLargestLabelIs) {
  const ScoredDrive drive = {SeenAt(0, {kThing}, {}), SeenAt(5, {kElsewhere, {0, 0, 30, 20}}, {}),
                             SeenAt(10, {kThing}, {})};
  const std::vector<MissedEvent> missed = FindMissedEvents(drive, 0.5);
  ASSERT_EQ(missed.size(), 1U);
  EXPECT_EQ(missed[0].frame, 1U);
}

TEST(FalseReports, BeginWhereTheyAreCountedAndSayWhatTheyAreAbout) {
  ScoredDrive drive = {SeenAt(0, {}, {{kElsewhere, 0.6F}, {kThing, 0.8F}, {kThing, 0.2F}}),
                       SeenAt(12, {}, {{kElsewhere, 0.9F}}),
                       SeenAt(13, {kThing}, {{kShifted, 0.7F}}),
                       SeenAt(40, {}, {{kElsewhere, 0.9F}})};
  drive[3].difficult = {kElsewhere};
  const std::vector<FalseReport> reports = FindFalseReports(drive, 0.5);
  ASSERT_EQ(reports.size(), CountFalse(drive, 0.5, 0.5).reports);
  ASSERT_EQ(reports.size(), 2U);
  EXPECT_EQ(reports[0].frame, 0U);
  EXPECT_EQ(reports[0].detection.box, kThing);
  EXPECT_EQ(reports[0].cause, FalseCause::kBackground);
  EXPECT_EQ(reports[1].frame, 2U);
  EXPECT_EQ(reports[1].cause, FalseCause::kMisplaced);
}

}  // namespace
}  // namespace livemap::evaluation
