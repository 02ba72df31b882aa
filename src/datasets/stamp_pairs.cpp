#include "datasets/stamp_pairs.h"

#include <algorithm>
#include <functional>
#include <numeric>
#include <queue>
#include <tuple>

namespace livemap::datasets {
namespace {

/// Which elements of a row are still free, next to a place; elements are taken one by one.
class FreeRow {
 public:
  explicit FreeRow(std::size_t size) : after_(size + 1), before_(size + 1) {
    std::iota(after_.begin(), after_.end(), 0);
    std::iota(before_.begin(), before_.end(), 0);
  }

  void Take(std::size_t index) {
    after_[index] = index + 1;
    before_[index + 1] = index;
  }
  bool IsFree(std::size_t index) const { return after_[index] == index; }
  /// The first free one from `index` on, the row's size when there is none.
  std::size_t After(std::size_t index) { return Follow(after_, index); }
  /// One more than the last free one before `index`, 0 when there is none.
  std::size_t Before(std::size_t index) { return Follow(before_, index); }

 private:
  /// Follows the links and shortens them.
  static std::size_t Follow(std::vector<std::size_t>& links, std::size_t index) {
    while (links[index] != index) {
      links[index] = links[links[index]];
      index = links[index];
    }
    return index;
  }

  std::vector<std::size_t> after_;
  std::vector<std::size_t> before_;
};

/// Distance of the stamps in ns, index of the first list, index of the second: ordered as they are
/// taken.
using Candidate = std::tuple<std::int64_t, std::size_t, std::size_t>;

/// Finds for each stamp of the first list the nearest one of the second that is still free.
class StampPairing {
 public:
  StampPairing(const std::vector<std::int64_t>& first, const std::vector<std::int64_t>& second,
               std::int64_t max_difference_ns)
      : first_(first),
        second_(second),
        max_difference_ns_(max_difference_ns),
        free_(second.size()) {}

  std::vector<std::pair<std::size_t, std::size_t>> Run() {
    for (std::size_t i = 0; i < first_.size(); ++i) Offer(i);
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    // A stamp's candidate can only get farther, so the nearest one that is free is the nearest of
    // all pairs.
    while (!candidates_.empty()) {
      const auto [difference, index, partner] = candidates_.top();
      candidates_.pop();
      if (free_.IsFree(partner)) {
        free_.Take(partner);
        pairs.emplace_back(index, partner);
      } else {
        Offer(index);
      }
    }
    std::sort(pairs.begin(), pairs.end());
    return pairs;
  }

 private:
  void Offer(std::size_t index) {
    const std::int64_t stamp = first_[index];
    const auto place = std::lower_bound(second_.begin(), second_.end(), stamp);
    const auto middle = static_cast<std::size_t>(place - second_.begin());
    const std::size_t after = free_.After(middle);
    const std::size_t before = free_.Before(middle);
    Candidate nearest(max_difference_ns_, index, 0);
    if (before > 0) {
      nearest = std::min(nearest, Candidate(stamp - second_[before - 1], index, before - 1));
    }
    if (after < second_.size()) {
      nearest = std::min(nearest, Candidate(second_[after] - stamp, index, after));
    }
    if (std::get<0>(nearest) < max_difference_ns_) candidates_.push(nearest);
  }

  const std::vector<std::int64_t>& first_;
  const std::vector<std::int64_t>& second_;
  const std::int64_t max_difference_ns_;
  FreeRow free_;
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> candidates_;
};

}  // namespace

std::vector<std::pair<std::size_t, std::size_t>> PairNearestStamps(
    const std::vector<std::int64_t>& first, const std::vector<std::int64_t>& second,
    std::int64_t max_difference_ns) {
  return StampPairing(first, second, max_difference_ns).Run();
}

}  // namespace livemap::datasets
