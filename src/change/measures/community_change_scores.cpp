#include "change/measures/community_change_scores.h"

#include <opencv2/imgproc.hpp>

namespace livemap::change {

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
      if (is[column] < protocol::kChangeClasses)
        CountOutcome(taken[column] != 0, is[column] != 0, counts);
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
