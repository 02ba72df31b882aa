#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <random>

namespace livemap::datasets {

/// Random numbers of sensors' errors, one after the other: the same seed gives the same numbers on
/// every platform, which the library's distributions do not. Not thread-safe.
class SeededRandom {
 public:
  explicit SeededRandom(std::uint64_t seed) : generator_(seed) {}

  /// Uniform in (0, 1).
  double Uniform() {
    // 53 bits, shifted by half a step so that neither 0 nor 1 comes.
    return (static_cast<double>(generator_() >> 11U) + 0.5) / 9007199254740992.0;
  }

  /// Two independent standard normal numbers, by Box and Muller's method.
  Eigen::Vector2d Normal() {
    constexpr double kTwoPi = 6.28318530717958647693;
    const double radius = std::sqrt(-2 * std::log(Uniform()));
    const double angle = kTwoPi * Uniform();
    return {radius * std::cos(angle), radius * std::sin(angle)};
  }

  double Exponential(double mean) { return -mean * std::log(Uniform()); }

 private:
  std::mt19937_64 generator_;
};

}  // namespace livemap::datasets
