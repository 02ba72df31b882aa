#include "receiver/receiver_clock.h"

#include <algorithm>
#include <cmath>

#include "common/time.h"

namespace livemap::receiver {
namespace {

// Slewing changes less between two reports; somebody who sets a clock changes more.
constexpr double kClockWasSetS = 0.2;

}  // namespace

void ReceiverClock::Add(std::int64_t stamp_ns, std::int64_t system_ns, std::int64_t steady_ns) {
  const std::int64_t system_minus_steady_ns = system_ns - steady_ns;
  if (std::abs(Seconds(system_minus_steady_ns - system_minus_steady_ns_)) > kClockWasSetS) Reset();
  system_minus_steady_ns_ = system_minus_steady_ns;
  differences_ns_.push_back(system_ns - stamp_ns);
  if (differences_ns_.size() > kReports) differences_ns_.pop_front();
}

std::optional<double> ReceiverClock::offset_s() const {
  if (differences_ns_.empty()) return std::nullopt;
  return Seconds(*std::min_element(differences_ns_.begin(), differences_ns_.end()));
}

}  // namespace livemap::receiver
