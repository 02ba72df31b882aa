#pragma once

#include <cstdint>
#include <optional>

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

/// `part` of `whole`; none of nothing.
std::optional<double> ShareOfCounts(std::uint64_t part, std::uint64_t whole);
/// Counts one pixel, of which something is predicted or not, and there or not.
void CountOutcome(bool predicted, bool there, BinaryCounts& counts);

}  // namespace livemap::change
