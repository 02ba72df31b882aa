#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "geo/geo_box.h"
#include "streets/street_map.h"
#include "web/json/json.h"
#include "web/ogc/ogc_query.h"
#include "zone/model/hazard.h"

namespace livemap::web {

/// Counts hazards on the ways of OpenStreetMap on which they lie.
class StreetCounts {
 public:
  /// Keeps the reference.
  explicit StreetCounts(const streets::StreetMap& map) : map_(map) {}

  /// One that lies on no street is not counted.
  void Add(const zone::Hazard& hazard);
  /// The first way after `after`, by the id of OpenStreetMap, that the query selects, as a GeoJSON
  /// Feature; null: there is none. `id` becomes its id.
  Json Next(const OgcQuery& query, std::uint64_t after, std::uint64_t& id) const;
  /// A box around the ways of that id with all hazards that may lie on them; none where the map has
  /// no such way. It looks at every segment of the map once.
  std::optional<geo::GeoBox> ReachOf(std::uint64_t id) const;
  /// That way; null where no hazard lies on it.
  Json Find(std::uint64_t id) const;

 private:
  struct Counted {
    std::uint32_t segment = 0;  ///< One of the way's.
    std::map<std::string, std::size_t> by_class;
    std::int64_t first_ns = 0;
    std::int64_t last_ns = 0;
  };

  Json Feature(std::uint64_t id, const Counted& counted) const;
  /// Positions of the way's lines: one line for each run of segments.
  Json Lines(std::uint32_t segment) const;
  bool Touches(const Json& lines, const geo::GeoBox& box) const;

  const streets::StreetMap& map_;
  std::map<std::uint64_t, Counted> ways_;
};

}  // namespace livemap::web
