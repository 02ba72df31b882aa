#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/queues/token_bucket.h"

namespace livemap::zone {

/// How many messages of each vehicle count: one bucket of tokens per vehicle and kind that refills
/// evenly over an hour, so that any hour takes at most twice the cap and the long run no more than
/// the cap. Memory is bounded whatever ids come: a vehicle silent for an hour has full buckets and
/// is forgotten; when there is no such one, new ids are refused. Needs not be stored: a restart
/// gives every vehicle at most one hour's cap more. Not thread-safe.
class VehicleAllowance {
 public:
  struct Config {
    double reports_per_hour = 3600;  ///< Per vehicle, >= 1.
    double evidence_per_hour = 240;  ///< Sightings of known hazards, answers, changes; >= 1.
    std::size_t max_vehicles = 50000;
  };

  explicit VehicleAllowance(const Config& config);

  /// Takes one report's (one evidence's) place; false when the vehicle has none left now. `now_ns`
  /// is the zone's clock; a step back of it takes nothing away.
  bool TakeReport(const std::string& vehicle_id, std::int64_t now_ns);
  bool TakeEvidence(const std::string& vehicle_id, std::int64_t now_ns);

  std::size_t vehicles() const { return buckets_.keys(); }

 private:
  bool Take(const std::string& vehicle_id, std::int64_t now_ns, std::size_t kind);

  /// For each vehicle one bucket of reports and one of evidence.
  KeyedTokenBuckets<2> buckets_;
};

}  // namespace livemap::zone
