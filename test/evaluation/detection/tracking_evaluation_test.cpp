#include "evaluation/detection/tracking_evaluation.h"

#include <gtest/gtest.h>

namespace livemap::evaluation {
namespace {

TEST(TrackingEvaluation, StampsFollowTheChainageAndNeverStandStill) {
  const TrackedDriveConfig options;
  const perception::TrackerFrame first = ToTrackerFrame({}, {640, 400}, 32, 0, options);
  EXPECT_EQ(first.stamp_ns, 2'000'000'000);
  EXPECT_GT(ToTrackerFrame({}, {640, 400}, 32, first.stamp_ns, options).stamp_ns, first.stamp_ns);
  EXPECT_FALSE(first.motion);
}

TEST(TrackingEvaluation, RepeatedSightsBecomeOneDetectionOfTheDrive) {
  const TrackedDriveConfig options;
  const cv::Rect2f box(300, 200, 40, 20);
  ScoredDrive labelled(3);
  std::vector<perception::TrackerFrame> frames;
  for (std::size_t i = 0; i < 3; ++i) {
    const float confidence = i == 1 ? 0.8F : 0.5F;
    labelled[i].chainage_m = static_cast<double>(i);
    labelled[i].labels = {box};
    labelled[i].detections = {{box, confidence}};
    frames.push_back(ToTrackerFrame({{"pothole", 0, confidence, box}}, {640, 400},
                                    labelled[i].chainage_m, i ? frames.back().stamp_ns : 0,
                                    options));
  }
  const perception::ObjectTracker tracker({}, {0.4F});
  const ScoredDrive events = EventsOfDrive(labelled, frames, "pothole", tracker);
  EXPECT_TRUE(events[0].detections.empty());
  EXPECT_EQ(events[1].detections.size(), 1U);
  EXPECT_TRUE(events[2].detections.empty());
  EXPECT_EQ(events[1].labels.size(), 1U);
  EXPECT_TRUE(EventsOfDrive(labelled, frames, "deer", tracker)[1].detections.empty());
}

}  // namespace
}  // namespace livemap::evaluation
