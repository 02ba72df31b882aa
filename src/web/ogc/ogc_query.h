#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "geo/geo_box.h"
#include "web/http/request_target.h"

namespace livemap::web {

/// A time interval, both ends included, UTC ns since 1970.
struct TimeSpan {
  std::int64_t begin_ns = std::numeric_limits<std::int64_t>::min();
  std::int64_t end_ns = std::numeric_limits<std::int64_t>::max();

  bool Meets(std::int64_t first_ns, std::int64_t last_ns) const {
    return first_ns <= end_ns && last_ns >= begin_ns;
  }
};

/// What the items of a collection are asked for (OGC API - Features - Part 1: Core, 7.15).
struct OgcQuery {
  std::optional<geo::GeoBox> box;
  std::optional<TimeSpan> time;
  std::size_t limit = 100;
  std::uint64_t cursor = 0;  ///< Only items after this one, in the order of the collection.
};

/// The most items of one page; a larger limit means this one.
constexpr std::size_t kMaxOgcItems = 10'000;

/// Reads `bbox` of four numbers or six, of which the heights do not count, `datetime`, `limit` and
/// `cursor`, which stands in links to next pages. Throws BadRequest naming the parameter, its value
/// and what is accepted; unknown and repeated parameters are refused too.
OgcQuery ParseOgcQuery(const RequestTarget& target);

/// Reads a time of RFC 3339 or two of them with '/' between, of which one may be ".." or nothing.
/// Throws BadRequest.
TimeSpan ParseDatetime(const std::string& text);

/// The address of the page after the one that was asked for: the same parameters, another cursor.
std::string NextPage(const RequestTarget& target, std::uint64_t cursor);

}  // namespace livemap::web
