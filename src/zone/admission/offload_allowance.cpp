#include "zone/admission/offload_allowance.h"

#include <algorithm>

#include "common/error.h"
#include "common/time.h"

namespace livemap::zone {
namespace {

constexpr double kMinuteS = 60;

}  // namespace

OffloadAllowance::OffloadAllowance(const Config& config) : config_(config) {
  if (!(config_.frames_per_minute >= 1) || !(config_.bytes_per_minute >= 1) ||
      config_.max_vehicles < 1) {
    throw Error("frames, bytes and vehicles of a candidate allowance must be at least 1");
  }
}

bool OffloadAllowance::Take(const std::string& vehicle_id, std::size_t bytes, std::int64_t now_ns) {
  Bucket* bucket = Find(vehicle_id, now_ns);
  if (bucket == nullptr) return false;
  const double minutes = std::max(0.0, Seconds(now_ns - bucket->at_ns)) / kMinuteS;
  bucket->frames =
      std::min(config_.frames_per_minute, bucket->frames + minutes * config_.frames_per_minute);
  bucket->bytes =
      std::min(config_.bytes_per_minute, bucket->bytes + minutes * config_.bytes_per_minute);
  bucket->at_ns = now_ns;
  by_use_.splice(by_use_.end(), by_use_, bucket->place);
  const auto size = static_cast<double>(bytes);
  if (bucket->frames < 1 || bucket->bytes < size) return false;
  bucket->frames -= 1;
  bucket->bytes -= size;
  return true;
}

OffloadAllowance::Bucket* OffloadAllowance::Find(const std::string& vehicle_id,
                                                 std::int64_t now_ns) {
  const auto found = buckets_.find(vehicle_id);
  if (found != buckets_.end()) return &found->second;
  if (buckets_.size() >= config_.max_vehicles) {
    const auto silent = buckets_.find(by_use_.front());
    // Its buckets are not surely full: forgetting it would give it more than its cap.
    if (Seconds(now_ns - silent->second.at_ns) < kMinuteS) return nullptr;
    by_use_.pop_front();
    buckets_.erase(silent);
  }
  const auto place = by_use_.insert(by_use_.end(), vehicle_id);
  const Bucket fresh{config_.frames_per_minute, config_.bytes_per_minute, now_ns, place};
  return &buckets_.emplace(vehicle_id, fresh).first->second;
}

}  // namespace livemap::zone
