#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace livemap::nodelets {

/// A warning that still holds is said again after this time.
constexpr double kSayAgainS = 60;

/// Seconds of the clock that neither simulated time nor the administrator moves.
double SteadyS();

/// ROS's clock, ns; 0 while simulated time has not begun.
std::int64_t RosNowNs();

/// Runs a nodelet's start-up. An exception, ours (one sentence) or a library's, is logged as one
/// line under the nodelet's name and rethrown, so that the manager reports a failed load and lives
/// on.
void InitializeOrExplain(const std::string& nodelet_name, const std::function<void()>& initialize);

}  // namespace livemap::nodelets
