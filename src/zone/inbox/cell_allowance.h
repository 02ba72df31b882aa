#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "common/queues/token_bucket.h"

namespace livemap::zone {

/// How many cells a vehicle may ask about, so that one that asks all the time takes nothing from
/// the others. Not thread-safe.
class CellAllowance {
 public:
  struct Config {
    double cells = 256;                ///< That may be asked about at once.
    double refill_s = 128;             ///< In which the vehicle gets as many again.
    std::size_t max_vehicles = 10000;  ///< Beyond it all are forgotten, which gives each its due.
  };

  explicit CellAllowance(const Config& config) : config_(config) {}

  /// Whether the vehicle may ask about so many cells now; then they are taken from what it may.
  bool Take(const std::string& vehicle_id, std::size_t cells, std::int64_t now_ns) {
    if (left_.size() >= config_.max_vehicles && left_.count(vehicle_id) == 0) left_.clear();
    TokenBucket& bucket =
        left_.try_emplace(vehicle_id, TokenBucket::Config{config_.cells, config_.refill_s})
            .first->second;
    bucket.Refill(now_ns);
    return bucket.Take(static_cast<double>(cells));
  }

 private:
  Config config_;
  std::map<std::string, TokenBucket> left_;
};

}  // namespace livemap::zone
