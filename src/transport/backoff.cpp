#include "transport/backoff.h"

#include <algorithm>
#include <string>

#include "common/error.h"

namespace livemap::transport {

Backoff::Backoff(double min_s, double max_s, std::uint64_t seed)
    : min_s_(min_s), max_s_(max_s), current_s_(min_s), generator_(seed) {
  if (!(min_s > 0 && max_s >= min_s)) {
    throw Error("reconnect delays from " + std::to_string(min_s) + " s to " +
                std::to_string(max_s) + " s are not accepted, the first must be above 0 and the " +
                "second no less than the first");
  }
}

double Backoff::NextDelayS() {
  const double delay_s = current_s_ * std::uniform_real_distribution<double>(0.5, 1.0)(generator_);
  current_s_ = std::min(2 * current_s_, max_s_);
  return delay_s;
}

}  // namespace livemap::transport
