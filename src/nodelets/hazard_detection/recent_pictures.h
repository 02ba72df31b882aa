#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <utility>
#include <vector>

namespace livemap::nodelets {

/// The newest pictures by stamp, of which any may be asked for, and older ones that are still
/// wanted. Not thread-safe.
template <typename Picture>
class RecentPictures {
 public:
  explicit RecentPictures(std::size_t capacity) : capacity_(capacity) {}

  /// Keeps `picture`; forgets the oldest ones over the capacity, but none of `wanted`. A stamp
  /// that goes back (a bag that is played again) forgets all.
  void Add(std::int64_t stamp_ns, Picture picture, const std::vector<std::int64_t>& wanted) {
    if (!pictures_.empty() && stamp_ns < pictures_.rbegin()->first) pictures_.clear();
    pictures_.insert_or_assign(stamp_ns, std::move(picture));
    auto oldest = pictures_.begin();
    for (std::size_t over = pictures_.size() > capacity_ ? pictures_.size() - capacity_ : 0;
         over > 0; --over) {
      bool is_wanted = false;
      for (const std::int64_t stamp : wanted) is_wanted = is_wanted || stamp == oldest->first;
      oldest = is_wanted ? std::next(oldest) : pictures_.erase(oldest);
    }
  }

  std::optional<Picture> Find(std::int64_t stamp_ns) const {
    const auto found = pictures_.find(stamp_ns);
    if (found == pictures_.end()) return std::nullopt;
    return found->second;
  }
  std::size_t size() const { return pictures_.size(); }

 private:
  std::size_t capacity_;
  std::map<std::int64_t, Picture> pictures_;
};

}  // namespace livemap::nodelets
