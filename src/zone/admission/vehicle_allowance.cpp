#include "zone/admission/vehicle_allowance.h"

#include <algorithm>

#include "common/error.h"
#include "common/time.h"

namespace livemap::zone {
namespace {

constexpr double kRefillS = 3600;

}  // namespace

VehicleAllowance::VehicleAllowance(const Config& config) : config_(config) {
  if (!(config_.reports_per_hour >= 1) || !(config_.evidence_per_hour >= 1) ||
      config_.max_vehicles < 1) {
    throw Error("caps per vehicle and hour, and the number of vehicles, must be at least 1");
  }
}

bool VehicleAllowance::TakeReport(const std::string& vehicle_id, std::int64_t now_ns) {
  return Take(vehicle_id, now_ns, &Buckets::reports);
}

bool VehicleAllowance::TakeEvidence(const std::string& vehicle_id, std::int64_t now_ns) {
  return Take(vehicle_id, now_ns, &Buckets::evidence);
}

bool VehicleAllowance::Take(const std::string& vehicle_id, std::int64_t now_ns,
                            double Buckets::*tokens) {
  Buckets* buckets = Find(vehicle_id, now_ns);
  if (buckets == nullptr) return false;
  const double elapsed_s = std::max(0.0, Seconds(now_ns - buckets->at_ns));
  const auto refill = [&](double& level, double per_hour) {
    level = std::min(per_hour, level + elapsed_s / kRefillS * per_hour);
  };
  refill(buckets->reports, config_.reports_per_hour);
  refill(buckets->evidence, config_.evidence_per_hour);
  buckets->at_ns = std::max(buckets->at_ns, now_ns);
  by_use_.splice(by_use_.end(), by_use_, buckets->place);
  if (buckets->*tokens < 1) return false;
  buckets->*tokens -= 1;
  return true;
}

VehicleAllowance::Buckets* VehicleAllowance::Find(const std::string& vehicle_id,
                                                  std::int64_t now_ns) {
  const auto found = buckets_.find(vehicle_id);
  if (found != buckets_.end()) return &found->second;
  if (buckets_.size() >= config_.max_vehicles) {
    const auto silent = buckets_.find(by_use_.front());
    // Its buckets are not surely full: forgetting it would give it more than its cap.
    if (Seconds(now_ns - silent->second.at_ns) < kRefillS) return nullptr;
    by_use_.pop_front();
    buckets_.erase(silent);
  }
  Buckets fresh;
  fresh.reports = config_.reports_per_hour;
  fresh.evidence = config_.evidence_per_hour;
  fresh.at_ns = now_ns;
  fresh.place = by_use_.insert(by_use_.end(), vehicle_id);
  return &buckets_.emplace(vehicle_id, fresh).first->second;
}

}  // namespace livemap::zone
