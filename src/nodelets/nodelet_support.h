#pragma once

#include <functional>
#include <string>

namespace livemap::nodelets {

/// A warning that still holds is said again after this time.
constexpr double kSayAgainS = 60;

/// Seconds of the clock that neither simulated time nor the administrator moves.
double SteadyS();

/// Runs a nodelet's start-up. A livemap::Error is logged as the one sentence that it is and
/// rethrown, so that the manager reports a failed load and lives on.
void InitializeOrExplain(const std::string& nodelet_name, const std::function<void()>& initialize);

}  // namespace livemap::nodelets
