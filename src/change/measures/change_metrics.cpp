#include "change/measures/change_metrics.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "common/error.h"

namespace livemap::change {
namespace {

std::optional<double> Share(std::uint64_t part, std::uint64_t whole) {
  if (whole == 0) return std::nullopt;
  return static_cast<double>(part) / static_cast<double>(whole);
}

std::uint64_t Sum(const std::vector<std::uint64_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

/// Of one pixel: what counts, given that change is predicted or not.
void Count(bool predicted, bool there, BinaryCounts& counts) {
  if (predicted) {
    ++(there ? counts.true_positive : counts.false_positive);
  } else {
    ++(there ? counts.false_negative : counts.true_negative);
  }
}

}  // namespace

void BinaryCounts::Add(const BinaryCounts& other) {
  true_positive += other.true_positive;
  false_positive += other.false_positive;
  false_negative += other.false_negative;
  true_negative += other.true_negative;
}

std::optional<double> BinaryCounts::precision() const {
  return Share(true_positive, true_positive + false_positive);
}

std::optional<double> BinaryCounts::recall() const {
  return Share(true_positive, true_positive + false_negative);
}

std::optional<double> BinaryCounts::false_positive_rate() const {
  return Share(false_positive, false_positive + true_negative);
}

std::optional<double> BinaryCounts::accuracy() const {
  return Share(true_positive + true_negative, total());
}

std::optional<double> BinaryCounts::f1() const {
  return Share(2 * true_positive, 2 * true_positive + false_positive + false_negative);
}

ScoreHistogram::ScoreHistogram() : positives_(kBins), negatives_(kBins) {}

std::uint64_t ScoreHistogram::positives() const { return Sum(positives_); }

std::uint64_t ScoreHistogram::negatives() const { return Sum(negatives_); }

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
    point.false_positive_rate = *Share(wrong, all_negatives);
    point.recall = *Share(right, all_positives);
    point.precision = Share(right, right + wrong);
    const bool last = right == all_positives && wrong == all_negatives;
    const bool near = !curve.empty() && point.recall - curve.back().recall < step &&
                      point.false_positive_rate - curve.back().false_positive_rate < step;
    if (!near || last) curve.push_back(point);
  }
  return curve;
}

PooledChangeScores::PooledChangeScores() : of_class_(protocol::kChangeClasses) {}

void PooledChangeScores::Add(const ChangeProbabilities& probabilities, const cv::Mat& truth,
                             bool with_classes) {
  const cv::Mat most_likely = MostLikely(probabilities);
  if (truth.type() != CV_8UC1 || truth.size() != most_likely.size()) {
    throw Error("a mask of " + SizeText(truth.size()) + " came with a prediction of " +
                SizeText(most_likely.size()) + ", accepted is the same size");
  }
  const bool classes = with_classes && probabilities.tells_classes();
  ++pairs_;
  pairs_with_classes_ += classes ? 1 : 0;
  for (int row = 0; row < truth.rows; ++row) {
    const auto* is = truth.ptr<std::uint8_t>(row);
    const auto* taken = most_likely.ptr<std::uint8_t>(row);
    const auto* no_change = probabilities.of_class[0].ptr<float>(row);
    for (int column = 0; column < truth.cols; ++column) {
      if (is[column] >= protocol::kChangeClasses) {
        ++left_out_;
        continue;
      }
      change_.Add(1.0F - no_change[column], is[column] != 0);
      Count(taken[column] != 0, is[column] != 0, at_most_likely_);
      if (!classes) continue;
      ++confusion_[is[column]][taken[column]];
      for (std::size_t i = 0; i < protocol::kChangeClasses; ++i) {
        of_class_[i].Add(probabilities.of_class[i].ptr<float>(row)[column], is[column] == i);
      }
    }
  }
}

std::optional<double> PooledChangeScores::MultiClassAccuracy() const {
  if (!tells_classes()) return std::nullopt;
  std::uint64_t right = 0;
  std::uint64_t found = 0;
  for (std::size_t is = 1; is < protocol::kChangeClasses; ++is) {
    right += confusion_[is][is];
    for (std::size_t taken = 1; taken < protocol::kChangeClasses; ++taken)
      found += confusion_[is][taken];
  }
  return Share(right, found);
}

void CommunityChangeScores::Add(const std::string& name, const ChangeProbabilities& probabilities,
                                const cv::Mat& truth) {
  const cv::Size size(kSide, kSide);
  ChangeProbabilities resized;
  for (const cv::Mat& image : probabilities.of_class) {
    resized.of_class.emplace_back();
    cv::resize(image, resized.of_class.back(), size, 0, 0, cv::INTER_LINEAR);
  }
  cv::Mat truth_resized;
  cv::resize(truth, truth_resized, size, 0, 0, cv::INTER_NEAREST);
  const cv::Mat most_likely = MostLikely(resized);
  BinaryCounts counts;
  for (int row = 0; row < kSide; ++row) {
    const auto* is = truth_resized.ptr<std::uint8_t>(row);
    const auto* taken = most_likely.ptr<std::uint8_t>(row);
    for (int column = 0; column < kSide; ++column) {
      if (is[column] < protocol::kChangeClasses) Count(taken[column] != 0, is[column] != 0, counts);
    }
  }
  pairs_.emplace_back(name, counts);
}

BinaryCounts CommunityChangeScores::Pooled() const {
  BinaryCounts pooled;
  for (const auto& [name, counts] : pairs_) pooled.Add(counts);
  return pooled;
}

std::optional<double> CommunityChangeScores::MeanF1() const {
  if (pairs_.empty()) return std::nullopt;
  double sum = 0;
  for (const auto& [name, counts] : pairs_) sum += counts.f1().value_or(0);
  return sum / static_cast<double>(pairs_.size());
}

std::optional<double> CommunityChangeScores::MeanF1WithChange() const {
  double sum = 0;
  std::size_t count = 0;
  for (const auto& [name, counts] : pairs_) {
    if (counts.true_positive + counts.false_negative == 0) continue;
    sum += *counts.f1();
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / static_cast<double>(count);
}

}  // namespace livemap::change
