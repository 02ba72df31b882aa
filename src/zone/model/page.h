#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "geo/geo_box.h"

namespace livemap::zone {

/// What a reader walks over page by page, in ascending order of the items' last events.
template <typename State>
struct Walk {
  std::optional<geo::GeoBox> box;    ///< Only items inside; none: everywhere.
  std::set<State> states;            ///< Only items in one of these; empty: in any.
  std::uint64_t after = 0;           ///< Only items whose sequence is larger.
  std::uint64_t until = UINT64_MAX;  ///< Only items whose sequence is at most this.
};

/// One page of a walk. The next one begins after `sequence`.
template <typename Item>
struct Page {
  std::vector<Item> items;
  std::uint64_t sequence = 0;  ///< Everything up to here was looked at.
  bool is_last = false;        ///< There is nothing more up to the walk's end.
};

/// The first `limit` items of a walk, by `read`, which reads a page of it: read(walk, limit).
template <typename State, typename Read>
auto ReadItems(Walk<State> walk, std::size_t limit, const Read& read) {
  auto page = read(walk, limit);
  auto items = std::move(page.items);
  while (!page.is_last && items.size() < limit) {
    walk.after = page.sequence;
    page = read(walk, limit - items.size());
    items.insert(items.end(), page.items.begin(), page.items.end());
  }
  return items;
}

/// A page looks at no more items than this, wanted or not, so that it holds nobody up: a few
/// milliseconds.
constexpr std::size_t kMaxLookedAtPerPage = 20000;

}  // namespace livemap::zone
