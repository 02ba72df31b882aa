#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "change/measures/binary_counts.h"

namespace livemap::change {

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
  /// What comes of a given threshold, within [0, 1].
  BinaryCounts AtThreshold(double threshold) const;
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

}  // namespace livemap::change
