#include "change/measures/binary_counts.h"

namespace livemap::change {

std::optional<double> ShareOfCounts(std::uint64_t part, std::uint64_t whole) {
  if (whole == 0) return std::nullopt;
  return static_cast<double>(part) / static_cast<double>(whole);
}

void CountOutcome(bool predicted, bool there, BinaryCounts& counts) {
  if (predicted) {
    ++(there ? counts.true_positive : counts.false_positive);
  } else {
    ++(there ? counts.false_negative : counts.true_negative);
  }
}

void BinaryCounts::Add(const BinaryCounts& other) {
  true_positive += other.true_positive;
  false_positive += other.false_positive;
  false_negative += other.false_negative;
  true_negative += other.true_negative;
}

std::optional<double> BinaryCounts::precision() const {
  return ShareOfCounts(true_positive, true_positive + false_positive);
}

std::optional<double> BinaryCounts::recall() const {
  return ShareOfCounts(true_positive, true_positive + false_negative);
}

std::optional<double> BinaryCounts::false_positive_rate() const {
  return ShareOfCounts(false_positive, false_positive + true_negative);
}

std::optional<double> BinaryCounts::accuracy() const {
  return ShareOfCounts(true_positive + true_negative, total());
}

std::optional<double> BinaryCounts::f1() const {
  return ShareOfCounts(2 * true_positive, 2 * true_positive + false_positive + false_negative);
}

}  // namespace livemap::change
