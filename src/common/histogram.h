#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/mutex.h"

namespace livemap {

/// How often durations fell between fixed bounds, from a millisecond to an hour, and their sum.
/// Thread-safe.
class DurationHistogram {
 public:
  /// Upper bounds, inclusive, in seconds; what is longer counts in one more.
  static constexpr std::array<double, 14> kBoundsS{0.001, 0.0025, 0.005, 0.01, 0.025, 0.1, 0.25,
                                                   1,     2.5,    10,    30,   120,   600, 3600};
  struct Counts {
    std::array<std::uint64_t, kBoundsS.size() + 1> by_bound{};  ///< Each duration in one of them.
    double sum_s = 0;
  };

  /// Counts a duration; a negative one, by a clock that was set back, as 0.
  void Add(double seconds) {
    const double counted = seconds > 0 ? seconds : 0;
    std::size_t bound = 0;
    while (bound < kBoundsS.size() && counted > kBoundsS.at(bound)) ++bound;
    const MutexLock lock(mutex_);
    ++counts_.by_bound.at(bound);
    counts_.sum_s += counted;
  }
  Counts counts() const {
    const MutexLock lock(mutex_);
    return counts_;
  }

 private:
  mutable Mutex mutex_;
  Counts counts_ GUARDED_BY(mutex_);
};

}  // namespace livemap
