#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "change/measures/binary_counts.h"
#include "change/methods/change_probabilities.h"

namespace livemap::change {

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
