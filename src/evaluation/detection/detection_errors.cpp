#include "evaluation/detection/detection_errors.h"

#include <algorithm>

namespace livemap::evaluation {
namespace {

float LargestMissedLabel(const ScoredFrame& frame) {
  float largest = 0;
  for (const cv::Rect2f& label : frame.labels) largest = std::max(largest, label.area());
  return largest;
}

/// What the event's frames have instead of a detection that recalls it.
MissedEvent ExplainMissedEvent(const ScoredDrive& drive, const std::vector<std::size_t>& event,
                               double threshold) {
  MissedEvent missed;
  missed.frame = *std::max_element(event.begin(), event.end(), [&](std::size_t a, std::size_t b) {
    return LargestMissedLabel(drive[a]) < LargestMissedLabel(drive[b]);
  });
  float misplaced = 0;
  float unsure = 0;
  for (const std::size_t index : event) {
    for (const ScoredBox& detection : drive[index].detections) {
      const double overlap = BestOverlap(detection, drive[index].labels);
      if (overlap >= 0.5) {
        unsure = std::max(unsure, detection.score);
      } else if (overlap >= kMisplacedIou && detection.score >= threshold) {
        misplaced = std::max(misplaced, detection.score);
      }
    }
  }
  if (misplaced > 0) {
    missed.cause = MissCause::kMisplaced;
    missed.score = misplaced;
  } else if (unsure > 0) {
    missed.cause = MissCause::kUnsure;
    missed.score = unsure;
  }
  return missed;
}

}  // namespace

std::vector<MissedEvent> FindMissedEvents(const ScoredDrive& drive, double threshold) {
  std::vector<MissedEvent> missed;
  for (const std::vector<std::size_t>& event : FindEvents(drive)) {
    if (!IsRecalled(drive, event, threshold, 0.5)) {
      missed.push_back(ExplainMissedEvent(drive, event, threshold));
    }
  }
  return missed;
}

std::vector<FalseReport> FindFalseReports(const ScoredDrive& drive, double threshold) {
  std::vector<FalseReport> reports;
  for (std::size_t index = 0; index < drive.size(); ++index) {
    const ScoredFrame& frame = drive[index];
    if (!reports.empty() &&
        frame.chainage_m - drive[reports.back().frame].chainage_m <= kEventGapM) {
      continue;
    }
    const ScoredBox* max_presence = nullptr;
    for (const ScoredBox& detection : frame.detections) {
      if (detection.score < threshold || !IsFalse(detection, frame, 0.5)) continue;
      if (max_presence == nullptr || detection.score > max_presence->score)
        max_presence = &detection;
    }
    if (max_presence == nullptr) continue;
    const bool about_label = BestOverlap(*max_presence, frame.labels) >= kMisplacedIou;
    reports.push_back(
        {index, *max_presence, about_label ? FalseCause::kMisplaced : FalseCause::kBackground});
  }
  return reports;
}

const char* CauseName(MissCause cause) {
  switch (cause) {
    case MissCause::kMisplaced:
      return "misplaced";
    case MissCause::kUnsure:
      return "unsure";
    case MissCause::kUnseen:
      break;
  }
  return "unseen";
}

const char* CauseName(FalseCause cause) {
  return cause == FalseCause::kMisplaced ? "misplaced" : "background";
}

}  // namespace livemap::evaluation
