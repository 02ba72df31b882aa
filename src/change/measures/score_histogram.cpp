#include "change/measures/score_histogram.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace livemap::change {

namespace {

std::uint64_t SumOfHistogram(const std::vector<std::uint64_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

}  // namespace

ScoreHistogram::ScoreHistogram() : positives_(kBins), negatives_(kBins) {}

std::uint64_t ScoreHistogram::positives() const { return SumOfHistogram(positives_); }

std::uint64_t ScoreHistogram::negatives() const { return SumOfHistogram(negatives_); }

std::optional<ScoreHistogram::Operation> ScoreHistogram::AtFalsePositiveRate(double rate) const {
  const std::uint64_t all_negatives = negatives();
  if (all_negatives == 0) return std::nullopt;
  const auto allowed = static_cast<double>(all_negatives) * rate;
  Operation operation;
  operation.threshold = 1 + 1.0 / (kBins - 1);
  operation.counts.false_negative = positives();
  operation.counts.true_negative = all_negatives;
  for (std::size_t bin = kBins; bin-- > 0;) {
    BinaryCounts& counts = operation.counts;
    // Rates like 0.1 are no binary numbers: a count that meets one exactly must not fail by that.
    if (static_cast<double>(counts.false_positive + negatives_[bin]) > allowed * (1 + 1e-12)) break;
    counts.true_positive += positives_[bin];
    counts.false_negative -= positives_[bin];
    counts.false_positive += negatives_[bin];
    counts.true_negative -= negatives_[bin];
    operation.threshold = static_cast<double>(bin) / (kBins - 1);
  }
  return operation;
}

BinaryCounts ScoreHistogram::AtThreshold(double threshold) const {
  const auto first = static_cast<std::size_t>(std::ceil(threshold * (kBins - 1) - 1e-6));
  BinaryCounts counts;
  for (std::size_t bin = 0; bin < kBins; ++bin) {
    (bin >= first ? counts.true_positive : counts.false_negative) += positives_[bin];
    (bin >= first ? counts.false_positive : counts.true_negative) += negatives_[bin];
  }
  return counts;
}

std::optional<double> ScoreHistogram::RocArea() const {
  const auto all_positives = static_cast<double>(positives());
  const auto all_negatives = static_cast<double>(negatives());
  if (all_positives == 0 || all_negatives == 0) return std::nullopt;
  double area = 0;
  double above = 0;
  for (std::size_t bin = kBins; bin-- > 0;) {
    const auto gain = static_cast<double>(positives_[bin]);
    area += static_cast<double>(negatives_[bin]) * (above + gain / 2);
    above += gain;
  }
  return area / all_positives / all_negatives;
}

std::optional<double> ScoreHistogram::AveragePrecision() const {
  const auto all_positives = static_cast<double>(positives());
  if (all_positives == 0) return std::nullopt;
  double area = 0;
  double right = 0;
  double predicted = 0;
  for (std::size_t bin = kBins; bin-- > 0;) {
    const auto gain = static_cast<double>(positives_[bin]);
    right += gain;
    predicted += gain + static_cast<double>(negatives_[bin]);
    if (gain > 0) area += gain * right / predicted;
  }
  return area / all_positives;
}

std::vector<ScoreHistogram::CurvePoint> ScoreHistogram::Curve(std::size_t points) const {
  std::vector<CurvePoint> curve;
  const std::uint64_t all_positives = positives();
  const std::uint64_t all_negatives = negatives();
  if (all_positives == 0 || all_negatives == 0) return curve;
  const double step = 1.0 / static_cast<double>(std::max<std::size_t>(points, 1));
  std::uint64_t right = 0;
  std::uint64_t wrong = 0;
  for (std::size_t bin = kBins; bin-- > 0;) {
    if (positives_[bin] == 0 && negatives_[bin] == 0) continue;
    right += positives_[bin];
    wrong += negatives_[bin];
    CurvePoint point;
    point.threshold = static_cast<double>(bin) / (kBins - 1);
    point.false_positive_rate = *ShareOfCounts(wrong, all_negatives);
    point.recall = *ShareOfCounts(right, all_positives);
    point.precision = ShareOfCounts(right, right + wrong);
    const bool last = right == all_positives && wrong == all_negatives;
    const bool near = !curve.empty() && point.recall - curve.back().recall < step &&
                      point.false_positive_rate - curve.back().false_positive_rate < step;
    if (!near || last) curve.push_back(point);
  }
  return curve;
}

}  // namespace livemap::change
