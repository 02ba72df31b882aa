#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace livemap::evaluation {

/// Figures of a detector on labelled frames. docs/reference/measures.md defines them; everything
/// here is about one class.

/// Labelled frames at most this far apart along the road belong to one event, false detections to
/// one false report; a longer gap between frames counts as this much of driven road.
constexpr double kEventGapM = 12.0;

/// One detection; px of the frame.
struct ScoredBox {
  cv::Rect2f box;
  float score = 0;  ///< 0..1
};

/// The labels and the detections of the class in one frame; boxes in px of the frame.
struct ScoredFrame {
  std::vector<cv::Rect2f> labels;
  std::vector<ScoredBox> detections;
  double chainage_m = 0;  ///< Place along the road; without meaning outside drives.
  /// Objects of the class that need not be found: a detection at least half of which lies in one
  /// is neither right nor wrong, unless it overlaps a label enough.
  std::vector<cv::Rect2f> difficult;
};

/// Frames in driving order: chainage does not descend.
using ScoredDrive = std::vector<ScoredFrame>;

/// Average precision: the area under the precision envelope over recall (all-point interpolation).
/// Detections are matched in descending score, each to the free label of its frame that it overlaps
/// most, if by at least `iou`. 0 without labels or detections.
double AveragePrecision(const std::vector<ScoredFrame>& frames, double iou);

/// Counts at a threshold, matched as for the average precision.
struct MatchCounts {
  std::size_t labels = 0;
  std::size_t detections = 0;  ///< With at least the threshold's score.
  std::size_t matched = 0;     ///< Of them, those with a label of their own.

  /// matched / detections, none without detections.
  std::optional<double> Precision() const;
  /// matched / labels, none without labels.
  std::optional<double> Recall() const;
};
MatchCounts CountMatches(const std::vector<ScoredFrame>& frames, double threshold, double iou);

/// An event: indices of a maximal run of labelled frames whose neighbours are at most kEventGapM
/// apart.
std::vector<std::vector<std::size_t>> FindEvents(const ScoredDrive& drive);

/// The largest IoU with one of `labels`, 0 without any.
double BestOverlap(const ScoredBox& detection, const std::vector<cv::Rect2f>& labels);

/// Whether it overlaps no label of its frame by at least `iou` and is about no difficult object.
bool IsFalse(const ScoredBox& detection, const ScoredFrame& frame, double iou);

/// Whether a detection of at least `threshold` overlaps a label of one of the event's frames by at
/// least `iou`.
bool IsRecalled(const ScoredDrive& drive, const std::vector<std::size_t>& event, double threshold,
                double iou);

/// How many of the drive's events are recalled.
std::size_t CountRecalledEvents(const ScoredDrive& drive, double threshold, double iou);

/// False detections of at least `threshold`, and the reports that they cause: in driving order one
/// starts a report unless its frame is within kEventGapM of the frame where the last report began.
struct FalseCounts {
  std::size_t detections = 0;
  std::size_t reports = 0;
};
FalseCounts CountFalse(const ScoredDrive& drive, double threshold, double iou);

/// Road that the frames cover: the sum of the gaps between neighbours, each at most kEventGapM.
double DrivenKm(const ScoredDrive& drive);

/// All figures of the class at one threshold.
struct ClassFigures {
  double threshold = 0;
  std::size_t frames = 0;  ///< In which the class is labelled.
  std::size_t labels = 0;
  std::optional<double> ap50;       ///< None without labels.
  std::optional<double> ap30;       ///< None without labels.
  std::optional<double> precision;  ///< At IoU 0.5.
  std::optional<double> recall;     ///< At IoU 0.5.
  std::size_t events = 0;
  std::optional<double> event_recall;        ///< At IoU 0.5; none without events.
  std::optional<double> event_recall_iou30;  ///< At IoU 0.3; none without events.
  double km = 0;
  std::size_t false_detections = 0;  ///< On drives, at IoU 0.5.
  std::size_t false_reports = 0;
  std::optional<double> false_per_km;  ///< False reports per km; none without drives.
};

/// `drives` and `photos` (frames that belong to no drive) together; events and false reports are
/// those of the drives.
ClassFigures EvaluateClass(const std::vector<ScoredDrive>& drives,
                           const std::vector<ScoredFrame>& photos, double threshold);

/// The same at several thresholds, with precision, recall, events and false reports only: average
/// precision does not depend on the threshold and stays 0.
std::vector<ClassFigures> SweepThresholds(const std::vector<ScoredDrive>& drives,
                                          const std::vector<ScoredFrame>& photos,
                                          const std::vector<double>& thresholds);

}  // namespace livemap::evaluation
