#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace livemap {

/// The middle one of the values (the upper of two), which must not be empty; reorders them.
template <typename Value>
Value TakeMedian(std::vector<Value>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The same of a copy.
template <typename Value>
Value MedianOf(std::vector<Value> values) {
  return TakeMedian(values);
}

/// The median of the magnitudes of errors times this is their standard deviation, if they are
/// normal; outliers do not change it.
inline constexpr double kMedianToSigma = 1.4826;

}  // namespace livemap
