#include "zone/admission/vehicle_allowance.h"

#include "common/error.h"

namespace livemap::zone {
namespace {

constexpr double kRefillS = 3600;
constexpr std::size_t kReports = 0;
constexpr std::size_t kEvidence = 1;

KeyedTokenBuckets<2> VehicleBucketsOf(const VehicleAllowance::Config& config) {
  if (!(config.reports_per_hour >= 1) || !(config.evidence_per_hour >= 1) ||
      config.max_vehicles < 1) {
    throw Error("caps per vehicle and hour, and the number of vehicles, must be at least 1");
  }
  return {{TokenBucket({config.reports_per_hour, kRefillS}),
           TokenBucket({config.evidence_per_hour, kRefillS})},
          config.max_vehicles,
          KeyedTokenBuckets<2>::Eviction::kOnlyFull};
}

}  // namespace

VehicleAllowance::VehicleAllowance(const Config& config) : buckets_(VehicleBucketsOf(config)) {}

bool VehicleAllowance::TakeReport(const std::string& vehicle_id, std::int64_t now_ns) {
  return Take(vehicle_id, now_ns, kReports);
}

bool VehicleAllowance::TakeEvidence(const std::string& vehicle_id, std::int64_t now_ns) {
  return Take(vehicle_id, now_ns, kEvidence);
}

bool VehicleAllowance::Take(const std::string& vehicle_id, std::int64_t now_ns, std::size_t kind) {
  auto* buckets = buckets_.Use(vehicle_id, now_ns);
  return buckets != nullptr && buckets->at(kind).Take(1);
}

}  // namespace livemap::zone
