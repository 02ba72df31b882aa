#pragma once

#include <cstdint>
#include <functional>
#include <queue>
#include <utility>
#include <vector>

namespace livemap::zone {

/// Which hazard is to be looked at when. One that is put off stays where it is until its old time:
/// whoever takes it looks again and puts it back. So the queue holds about one entry per hazard
/// however often they change. Not thread-safe.
class DueQueue {
 public:
  static constexpr std::int64_t kNotDue = INT64_MAX;

  /// `slot` is due at `at_ns`, or earlier if it was to be before; kNotDue: no need.
  void Set(std::uint32_t slot, std::int64_t at_ns) {
    if (slot >= earliest_.size()) earliest_.resize(slot + 1, kNotDue);
    if (at_ns >= earliest_[slot]) return;
    earliest_[slot] = at_ns;
    queue_.emplace(at_ns, slot);
  }
  /// Those due at `now_ns`, at most `limit`; they are out of the queue then.
  std::vector<std::uint32_t> Take(std::int64_t now_ns, std::size_t limit) {
    std::vector<std::uint32_t> taken;
    while (!queue_.empty() && queue_.top().first <= now_ns && taken.size() < limit) {
      const auto [at_ns, slot] = queue_.top();
      queue_.pop();
      if (earliest_[slot] != at_ns) continue;
      earliest_[slot] = kNotDue;
      taken.push_back(slot);
    }
    return taken;
  }

 private:
  using Entry = std::pair<std::int64_t, std::uint32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
  std::vector<std::int64_t> earliest_;  ///< By slot.
};

}  // namespace livemap::zone
