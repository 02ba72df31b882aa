#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace livemap::localization {

/// The middle one of the values (the upper of two), which must not be empty; reorders them.
inline double TakeMedian(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace livemap::localization
