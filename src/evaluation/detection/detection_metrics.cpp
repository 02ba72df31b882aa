#include "evaluation/detection/detection_metrics.h"

#include <algorithm>
#include <iterator>

#include "perception/detection/yolox_decoder.h"

namespace livemap::evaluation {
namespace {

struct ScoredMatch {
  float score = 0;
  bool matched = false;
};

/// Share of a detection that a box has to cover for the detection to be about that box, as for the
/// "don't care" regions of KITTI's object benchmark.
constexpr float kShareInDifficult = 0.5F;

bool IsOnDifficultLabel(const ScoredBox& detection, const ScoredFrame& frame) {
  return std::any_of(
      frame.difficult.begin(), frame.difficult.end(), [&](const cv::Rect2f& difficult) {
        return (detection.box & difficult).area() >= kShareInDifficult * detection.box.area();
      });
}

/// Matches the frame's detections to its labels, appending one entry per detection that is right or
/// wrong.
void MatchDetectionFrame(const ScoredFrame& frame, double iou, std::vector<ScoredMatch>& matches) {
  std::vector<const ScoredBox*> descending;
  for (const ScoredBox& detection : frame.detections) descending.push_back(&detection);
  std::stable_sort(descending.begin(), descending.end(),
                   [](const ScoredBox* a, const ScoredBox* b) { return a->score > b->score; });
  std::vector<bool> taken(frame.labels.size(), false);
  for (const ScoredBox* detection : descending) {
    double best_overlap = 0;
    std::size_t best = frame.labels.size();
    for (std::size_t label = 0; label < frame.labels.size(); ++label) {
      if (taken[label]) continue;
      const double overlap = perception::IntersectionOverUnion(detection->box, frame.labels[label]);
      if (overlap > best_overlap) {
        best_overlap = overlap;
        best = label;
      }
    }
    const bool matched = best < frame.labels.size() && best_overlap >= iou;
    if (matched) taken[best] = true;
    if (!matched && IsOnDifficultLabel(*detection, frame)) continue;
    matches.push_back({detection->score, matched});
  }
}

std::vector<ScoredMatch> MatchDetectionFrames(const std::vector<ScoredFrame>& frames, double iou) {
  std::vector<ScoredMatch> matches;
  for (const ScoredFrame& frame : frames) MatchDetectionFrame(frame, iou, matches);
  std::stable_sort(matches.begin(), matches.end(),
                   [](const ScoredMatch& a, const ScoredMatch& b) { return a.score > b.score; });
  return matches;
}

std::size_t CountLabelsForMetrics(const std::vector<ScoredFrame>& frames) {
  std::size_t labels = 0;
  for (const ScoredFrame& frame : frames) labels += frame.labels.size();
  return labels;
}

std::vector<ScoredFrame> PoolDetectionFrames(const std::vector<ScoredDrive>& drives,
                                             const std::vector<ScoredFrame>& photos) {
  std::vector<ScoredFrame> all;
  for (const ScoredDrive& drive : drives) all.insert(all.end(), drive.begin(), drive.end());
  all.insert(all.end(), photos.begin(), photos.end());
  return all;
}

/// A ratio, none when nothing was counted.
std::optional<double> MetricRatio(std::size_t part, std::size_t whole) {
  if (whole == 0) return std::nullopt;
  return static_cast<double>(part) / static_cast<double>(whole);
}

ClassFigures MetricsAtThreshold(const std::vector<ScoredDrive>& drives,
                                const std::vector<ScoredFrame>& all, double threshold) {
  ClassFigures figures;
  figures.threshold = threshold;
  figures.frames = all.size();
  const MatchCounts counts = CountMatches(all, threshold, 0.5);
  figures.labels = counts.labels;
  figures.precision = counts.Precision();
  figures.recall = counts.Recall();
  std::size_t recalled = 0;
  std::size_t recalled_iou30 = 0;
  for (const ScoredDrive& drive : drives) {
    figures.events += FindEvents(drive).size();
    recalled += CountRecalledEvents(drive, threshold, 0.5);
    recalled_iou30 += CountRecalledEvents(drive, threshold, 0.3);
    const FalseCounts wrong = CountFalse(drive, threshold, 0.5);
    figures.false_detections += wrong.detections;
    figures.false_reports += wrong.reports;
    figures.km += DrivenKm(drive);
  }
  figures.event_recall = MetricRatio(recalled, figures.events);
  figures.event_recall_iou30 = MetricRatio(recalled_iou30, figures.events);
  if (figures.km > 0) {
    figures.false_per_km = static_cast<double>(figures.false_reports) / figures.km;
  }
  return figures;
}

}  // namespace

double AveragePrecision(const std::vector<ScoredFrame>& frames, double iou) {
  const std::vector<ScoredMatch> matches = MatchDetectionFrames(frames, iou);
  const std::size_t labels = CountLabelsForMetrics(frames);
  if (labels == 0) return 0;
  std::vector<double> precision;
  std::size_t matched = 0;
  for (const ScoredMatch& match : matches) {
    matched += match.matched ? 1 : 0;
    precision.push_back(static_cast<double>(matched) / static_cast<double>(precision.size() + 1));
  }
  // Each match adds 1 / labels of recall at the best precision that this or more recall still has.
  double area = 0;
  double envelope = 0;
  for (std::size_t i = matches.size(); i-- > 0;) {
    envelope = std::max(envelope, precision[i]);
    if (matches[i].matched) area += envelope;
  }
  return area / static_cast<double>(labels);
}

std::optional<double> MatchCounts::Precision() const { return MetricRatio(matched, detections); }

std::optional<double> MatchCounts::Recall() const { return MetricRatio(matched, labels); }

MatchCounts CountMatches(const std::vector<ScoredFrame>& frames, double threshold, double iou) {
  MatchCounts counts;
  counts.labels = CountLabelsForMetrics(frames);
  // Matching goes down in score, so weaker detections take no label from those that count here.
  for (const ScoredMatch& match : MatchDetectionFrames(frames, iou)) {
    if (match.score < threshold) break;
    ++counts.detections;
    counts.matched += match.matched ? 1 : 0;
  }
  return counts;
}

std::vector<std::vector<std::size_t>> FindEvents(const ScoredDrive& drive) {
  std::vector<std::vector<std::size_t>> events;
  for (std::size_t i = 0; i < drive.size(); ++i) {
    if (drive[i].labels.empty()) continue;
    const bool continues =
        !events.empty() &&
        drive[i].chainage_m - drive[events.back().back()].chainage_m <= kEventGapM;
    if (!continues) events.emplace_back();
    events.back().push_back(i);
  }
  return events;
}

double BestOverlap(const ScoredBox& detection, const std::vector<cv::Rect2f>& labels) {
  double best = 0;
  for (const cv::Rect2f& label : labels) {
    best = std::max(best, perception::IntersectionOverUnion(detection.box, label));
  }
  return best;
}

bool IsFalse(const ScoredBox& detection, const ScoredFrame& frame, double iou) {
  return BestOverlap(detection, frame.labels) < iou && !IsOnDifficultLabel(detection, frame);
}

bool IsRecalled(const ScoredDrive& drive, const std::vector<std::size_t>& event, double threshold,
                double iou) {
  return std::any_of(event.begin(), event.end(), [&](std::size_t index) {
    const ScoredFrame& frame = drive[index];
    return std::any_of(
        frame.detections.begin(), frame.detections.end(), [&](const ScoredBox& detection) {
          return detection.score >= threshold && BestOverlap(detection, frame.labels) >= iou;
        });
  });
}

std::size_t CountRecalledEvents(const ScoredDrive& drive, double threshold, double iou) {
  const std::vector<std::vector<std::size_t>> events = FindEvents(drive);
  return static_cast<std::size_t>(
      std::count_if(events.begin(), events.end(), [&](const std::vector<std::size_t>& event) {
        return IsRecalled(drive, event, threshold, iou);
      }));
}

FalseCounts CountFalse(const ScoredDrive& drive, double threshold, double iou) {
  FalseCounts counts;
  std::optional<double> last_began_m;
  for (const ScoredFrame& frame : drive) {
    const auto wrong = std::count_if(
        frame.detections.begin(), frame.detections.end(), [&](const ScoredBox& detection) {
          return detection.score >= threshold && IsFalse(detection, frame, iou);
        });
    if (wrong == 0) continue;
    counts.detections += static_cast<std::size_t>(wrong);
    if (!last_began_m || frame.chainage_m - *last_began_m > kEventGapM) {
      ++counts.reports;
      last_began_m = frame.chainage_m;
    }
  }
  return counts;
}

double DrivenKm(const ScoredDrive& drive) {
  double metres = 0;
  for (std::size_t i = 1; i < drive.size(); ++i) {
    metres += std::min(drive[i].chainage_m - drive[i - 1].chainage_m, kEventGapM);
  }
  return metres / 1000;
}

ClassFigures EvaluateClass(const std::vector<ScoredDrive>& drives,
                           const std::vector<ScoredFrame>& photos, double threshold) {
  const std::vector<ScoredFrame> all = PoolDetectionFrames(drives, photos);
  ClassFigures figures = MetricsAtThreshold(drives, all, threshold);
  if (figures.labels > 0) {
    figures.ap50 = AveragePrecision(all, 0.5);
    figures.ap30 = AveragePrecision(all, 0.3);
  }
  return figures;
}

std::vector<ClassFigures> SweepThresholds(const std::vector<ScoredDrive>& drives,
                                          const std::vector<ScoredFrame>& photos,
                                          const std::vector<double>& thresholds) {
  const std::vector<ScoredFrame> all = PoolDetectionFrames(drives, photos);
  std::vector<ClassFigures> sweep;
  std::transform(thresholds.begin(), thresholds.end(), std::back_inserter(sweep),
                 [&](double threshold) { return MetricsAtThreshold(drives, all, threshold); });
  return sweep;
}

}  // namespace livemap::evaluation
