#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "datasets/seeded_random.h"

namespace livemap::datasets {

/// What a satellite receiver does to a position. Errors are horizontal, equal and independent in
/// east and north.
struct GnssReceiverNoise {
  double white_sigma_m = 0.5;        ///< New at every fix.
  double bias_sigma_m = 0;           ///< Slow error: first-order Gauss-Markov, long-term sigma.
  double bias_time_constant_s = 60;  ///< After this time the bias still correlates by 1/e.
  double dropouts_per_minute = 0;    ///< Mean rate at which the receiver loses its fix.
  double dropout_mean_s = 3;         ///< Mean length of a loss, exponentially distributed.
};

/// Throws Error naming the value when one is negative, not finite or, for the times, zero.
void Check(const GnssReceiverNoise& noise);

/// Gives the receiver's errors one fix after the other. The same seed gives the same errors on
/// every platform. Not thread-safe.
class GnssReceiverModel {
 public:
  GnssReceiverModel(const GnssReceiverNoise& noise, std::uint64_t seed);

  /// Error of the fix at `time_s` (not decreasing), east and north in metres; none while the
  /// receiver has no fix.
  std::optional<Eigen::Vector2d> ErrorAt(double time_s);

  /// What an honest receiver states per axis: sqrt(white^2 + bias^2), m.
  double sigma_m() const;

 private:
  const GnssReceiverNoise noise_;
  SeededRandom random_;
  Eigen::Vector2d bias_m_;
  double bias_time_s_ = 0;
  bool started_ = false;
  double dropout_start_s_ = 0;
  double dropout_end_s_ = 0;
};

}  // namespace livemap::datasets
