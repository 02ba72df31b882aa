#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "change/methods/change_probabilities.h"
#include "protocol/change_class.h"

namespace livemap::change {

/// Two outcomes, counted over pixels.
struct BinaryCounts {
  std::uint64_t true_positive = 0;
  std::uint64_t false_positive = 0;
  std::uint64_t false_negative = 0;
  std::uint64_t true_negative = 0;

  void Add(const BinaryCounts& other);
  std::uint64_t total() const {
    return true_positive + false_positive + false_negative + true_negative;
  }
  /// None where nothing was predicted, nothing was there, or there was nothing at all.
  std::optional<double> precision() const;
  std::optional<double> recall() const;
  std::optional<double> false_positive_rate() const;
  std::optional<double> accuracy() const;
  /// 2 TP / (2 TP + FP + FN), the harmonic mean of precision and recall; none when nothing was
  /// there and nothing predicted.
  std::optional<double> f1() const;
};

/// A score per pixel against a yes or no, however many pixels: two histograms.
class ScoreHistogram {
 public:
  /// Scores closer than this are one: of 16-bit images none are lost.
  static constexpr std::size_t kBins = 65536;

  /// What a threshold gives; a pixel counts as predicted when its score is at least that.
  struct Operation {
    double threshold = 0;  ///< Above 1: nothing is predicted.
    BinaryCounts counts;
  };
  struct CurvePoint {
    double threshold = 0;
    double false_positive_rate = 0;
    double recall = 0;
    std::optional<double> precision;
  };

  ScoreHistogram();

  /// `score` within [0, 1].
  void Add(float score, bool positive) {
    const auto bin = static_cast<std::size_t>(std::lround(score * static_cast<float>(kBins - 1)));
    ++(positive ? positives_ : negatives_)[bin];
  }
  std::uint64_t positives() const;
  std::uint64_t negatives() const;

  /// The lowest threshold whose share of false positives is not above `rate`: nothing between two
  /// scores is invented. None without negatives.
  std::optional<Operation> AtFalsePositiveRate(double rate) const;
  /// Area under the ROC curve, trapezoids; none without positives or negatives.
  std::optional<double> RocArea() const;
  /// Area under the precision-recall curve as the sum of precision times the gain in recall from
  /// threshold to threshold; none without positives.
  std::optional<double> AveragePrecision() const;
  /// From the highest threshold down, thinned so that neighbours are about 1 / `points` apart.
  std::vector<CurvePoint> Curve(std::size_t points) const;

 private:
  std::vector<std::uint64_t> positives_;
  std::vector<std::uint64_t> negatives_;
};

/// Pixels by what they are (row) and what they are most likely taken for (column).
using ChangeConfusion =
    std::array<std::array<std::uint64_t, protocol::kChangeClasses>, protocol::kChangeClasses>;

/// The thesis's protocol (4.5), pooled over all pixels of all pairs.
class PooledChangeScores {
 public:
  PooledChangeScores();

  /// One pair. `truth` is CV_8UC1 of the probabilities' size: ChangeClass or kLeftOutPixel. When
  /// the truth says `with_classes` false, its only classes are 0 and 1, and the pair counts for
  /// the figures without classes alone. Throws Error when the sizes differ.
  void Add(const ChangeProbabilities& probabilities, const cv::Mat& truth, bool with_classes);

  std::uint64_t pixels() const { return at_most_likely_.total(); }
  std::uint64_t left_out() const { return left_out_; }
  /// Every pair told classes, in the truth and in the prediction.
  bool tells_classes() const { return pairs_ > 0 && pairs_with_classes_ == pairs_; }

  /// Score: 1 - probability of no change.
  const ScoreHistogram& change() const { return change_; }
  /// One class against the rest, by its probability.
  const ScoreHistogram& of_class(protocol::ChangeClass change_class) const {
    return of_class_[static_cast<std::size_t>(change_class)];
  }
  /// Change is where no change is not the most likely.
  const BinaryCounts& at_most_likely() const { return at_most_likely_; }
  const ChangeConfusion& confusion() const { return confusion_; }
  /// Share of the pixels with the right class among those that rightly count as change, as the
  /// thesis defines it; none when there are no such.
  std::optional<double> MultiClassAccuracy() const;

 private:
  ScoreHistogram change_;
  std::vector<ScoreHistogram> of_class_;
  BinaryCounts at_most_likely_;
  ChangeConfusion confusion_{};
  std::uint64_t left_out_ = 0;
  std::size_t pairs_ = 0;
  std::size_t pairs_with_classes_ = 0;
};

/// The protocol of later work on VL-CMU-CD: everything at 512x512, change where no change is not
/// the most likely, F1 of each pair and of all pixels together.
class CommunityChangeScores {
 public:
  static constexpr int kSide = 512;

  /// Resizes the probabilities (linear) and the truth (nearest) first.
  void Add(const std::string& name, const ChangeProbabilities& probabilities, const cv::Mat& truth);

  const std::vector<std::pair<std::string, BinaryCounts>>& pairs() const { return pairs_; }
  BinaryCounts Pooled() const;
  /// Mean of the pairs' F1. As in published code a pair whose F1 is not defined, or without a
  /// right pixel, counts 0.
  std::optional<double> MeanF1() const;
  /// The same over pairs in which something changed.
  std::optional<double> MeanF1WithChange() const;

 private:
  std::vector<std::pair<std::string, BinaryCounts>> pairs_;
};

}  // namespace livemap::change
