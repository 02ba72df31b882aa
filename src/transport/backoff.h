#pragma once

#include <cstdint>
#include <random>

namespace livemap::transport {

/// Waiting times between attempts: doubling from `min_s` to `max_s`, each shortened at random by
/// up to a half so that a whole fleet does not knock at the same moment.
class Backoff {
 public:
  /// 0 < min_s <= max_s, seconds; throws Error otherwise.
  Backoff(double min_s, double max_s, std::uint64_t seed);

  /// Seconds to wait before the next attempt.
  double NextDelayS();
  /// The last attempt held: start again from `min_s`.
  void Reset() { current_s_ = min_s_; }

 private:
  double min_s_;
  double max_s_;
  double current_s_;
  std::mt19937_64 generator_;
};

}  // namespace livemap::transport
