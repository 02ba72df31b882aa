#pragma once

#include <vector>

#include "evaluation/detection/detection_metrics.h"

namespace livemap::evaluation {

/// Overlap with a label from which on a detection that overlaps it by less than IoU 0.5 is about
/// that label all the same.
constexpr double kMisplacedIou = 0.1;

/// What a detector did instead of recalling an event.
enum class MissCause {
  kMisplaced,  ///< A detection at the threshold is about one of its labels, with IoU below 0.5.
  kUnsure,     ///< Some detection overlaps a label by IoU 0.5, but is below the threshold.
  kUnseen,     ///< Neither.
};

/// An event that no detection recalls at IoU 0.5.
struct MissedEvent {
  std::size_t frame = 0;  ///< Of the drive: the event's frame with the largest label.
  MissCause cause = MissCause::kUnseen;
  float score = 0;  ///< Of the best detection that the cause speaks of; 0 for kUnseen.
};

/// What a false report is about.
enum class FalseCause {
  kMisplaced,   ///< A label, with IoU below 0.5.
  kBackground,  ///< Nothing that is labelled.
};

/// A false report, at the frame where it begins.
struct FalseReport {
  std::size_t frame = 0;
  ScoredBox detection;  ///< The max_presence false one there.
  FalseCause cause = FalseCause::kBackground;
};

/// The events that CountRecalledEvents does not count at IoU 0.5, in driving order.
std::vector<MissedEvent> FindMissedEvents(const ScoredDrive& drive, double threshold);
/// The reports that CountFalse counts at IoU 0.5, in driving order.
std::vector<FalseReport> FindFalseReports(const ScoredDrive& drive, double threshold);

/// "misplaced", "unsure", "unseen".
const char* CauseName(MissCause cause);
/// "misplaced", "background".
const char* CauseName(FalseCause cause);

}  // namespace livemap::evaluation
