#include "zone/admission/offload_allowance.h"

#include "common/error.h"

namespace livemap::zone {
namespace {

constexpr double kMinuteS = 60;

KeyedTokenBuckets<2> OffloadBucketsOf(const OffloadAllowance::Config& config) {
  if (!(config.frames_per_minute >= 1) || !(config.bytes_per_minute >= 1) ||
      config.max_vehicles < 1) {
    throw Error("frames, bytes and vehicles of a candidate allowance must be at least 1");
  }
  const auto step_back = TokenBucket::StepBack::kFollow;
  return {{TokenBucket({config.frames_per_minute, kMinuteS, step_back}),
           TokenBucket({config.bytes_per_minute, kMinuteS, step_back})},
          config.max_vehicles,
          KeyedTokenBuckets<2>::Eviction::kOnlyFull};
}

}  // namespace

OffloadAllowance::OffloadAllowance(const Config& config) : buckets_(OffloadBucketsOf(config)) {}

bool OffloadAllowance::Take(const std::string& vehicle_id, std::size_t bytes, std::int64_t now_ns) {
  auto* buckets = buckets_.Use(vehicle_id, now_ns);
  if (buckets == nullptr) return false;
  auto& [frames_left, bytes_left] = *buckets;
  return frames_left.tokens() >= 1 && bytes_left.Take(static_cast<double>(bytes)) &&
         frames_left.Take(1);
}

}  // namespace livemap::zone
