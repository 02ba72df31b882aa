#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "change/measures/binary_counts.h"
#include "change/measures/score_histogram.h"
#include "change/methods/change_probabilities.h"
#include "protocol/change_class.h"

namespace livemap::change {

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

}  // namespace livemap::change
