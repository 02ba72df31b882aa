#include "change/measures/pooled_change_scores.h"

#include "common/error.h"

namespace livemap::change {

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
      CountOutcome(taken[column] != 0, is[column] != 0, at_most_likely_);
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
  return ShareOfCounts(right, found);
}

}  // namespace livemap::change
