#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace livemap::datasets {

/// As the TUM benchmark's associate.py: of all pairs of a stamp of the first list and one of the
/// second that are less than `max_difference_ns` apart, the nearest pair first, and every stamp
/// once (of equally near ones the earlier of the first list, then the earlier of the second). Both
/// lists increase. Indices into the two lists, in the order of the first; O(n log n).
std::vector<std::pair<std::size_t, std::size_t>> PairNearestStamps(
    const std::vector<std::int64_t>& first, const std::vector<std::int64_t>& second,
    std::int64_t max_difference_ns);

}  // namespace livemap::datasets
