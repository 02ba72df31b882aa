#pragma once

#include <functional>
#include <string>

namespace livemap {

/// Runs a nodelet's start-up. A livemap::Error is logged as the one sentence that it is and
/// rethrown, so that the manager reports a failed load and lives on.
void InitializeOrExplain(const std::string& nodelet_name, const std::function<void()>& initialize);

}  // namespace livemap
