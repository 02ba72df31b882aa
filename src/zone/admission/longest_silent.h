#pragma once

#include <algorithm>
#include <cstddef>

namespace livemap::zone {

/// Makes room for one more entry in a map by vehicle: of `max_entries` or more the one
/// whose `heard_ns` is the oldest goes.
template <typename Entries>
void ForgetLongestSilent(Entries& entries, std::size_t max_entries) {
  if (entries.empty() || entries.size() < max_entries) return;
  entries.erase(std::min_element(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
    return a.second.heard_ns < b.second.heard_ns;
  }));
}

}  // namespace livemap::zone
