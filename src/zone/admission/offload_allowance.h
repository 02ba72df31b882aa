#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/queues/token_bucket.h"

namespace livemap::zone {

/// How many candidate frames and bytes of them the zone takes from each vehicle: two buckets that
/// refill evenly over a minute. Memory is bounded: a vehicle silent for a minute has full buckets
/// and is forgotten; when there is no such one, new ids are refused. Not thread-safe.
class OffloadAllowance {
 public:
  struct Config {
    double frames_per_minute =
        240;                        ///< Per vehicle, >= 1: a third above the 3 per second it sends.
    double bytes_per_minute = 6e6;  ///< Per vehicle, >= 1: 0.8 Mbit/s.
    std::size_t max_vehicles = 10000;
  };

  /// Throws Error for a cap below 1.
  explicit OffloadAllowance(const Config& config);

  /// Takes the place of one frame of `bytes`; false, and nothing is taken, when the vehicle has
  /// none left now. `now_ns` is the zone's clock; a step back of it takes nothing away.
  bool Take(const std::string& vehicle_id, std::size_t bytes, std::int64_t now_ns);

  std::size_t vehicles() const { return buckets_.keys(); }

 private:
  /// For each vehicle one bucket of frames and one of bytes.
  KeyedTokenBuckets<2> buckets_;
};

}  // namespace livemap::zone
