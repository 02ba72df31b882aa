#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "geo/geo_box.h"
#include "geo/wgs84.h"
#include "streets/street_map.h"

namespace livemap::streets {

/// A street, or a piece of one, as a line to be drawn.
struct StreetLine {
  std::uint32_t segment = 0;          ///< Its first one, for StreetMap::StreetOf.
  std::vector<geo::GeoPoint> points;  ///< At least two.
};

/// The streets of a map as lines, found by place and zoom. It takes some 60 bytes per street beside
/// the map. It does not change after it is made, and threads may share it.
class StreetLines {
 public:
  /// What is drawn in a box.
  struct Drawing {
    std::vector<StreetLine> lines;  ///< The most important first.
    bool is_truncated = false;      ///< There would have been more.
  };

  /// Keeps the reference.
  explicit StreetLines(const StreetMap& map);

  /// The least important kind of street that is drawn at a zoom of web maps (the world is
  /// 256 * 2^zoom pixels wide): motorways and trunks always, primary ones from 9 on, secondary from
  /// 11, tertiary from 12, residential from 13, service from 15.
  static StreetKind LeastKindAt(int zoom);

  /// The lines that touch the box, which may not cross the antimeridian, of the kinds of that zoom,
  /// simplified to half a pixel of it; at most `max_points` points together, the more important
  /// kinds first.
  Drawing Find(const geo::GeoBox& box, int zoom, std::size_t max_points) const;
  const StreetMap& map() const { return map_; }

 private:
  /// Segments of one street that follow each other, with the box around them in 1e-7 degrees.
  struct Run {
    std::uint32_t first;
    std::uint32_t count;
    std::int32_t south, west, north, east;
  };
  /// The runs of one kind by place.
  struct Level {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> cells;  ///< Key and run, sorted.
    std::vector<std::uint32_t> large;                            ///< Runs over very many cells.
  };

  void AddRun(std::uint32_t first, std::uint32_t end);
  std::vector<std::uint32_t> RunsIn(const Level& level, const Run& box) const;
  StreetLine LineOf(const Run& run, double tolerance_deg) const;

  const StreetMap& map_;
  std::vector<Run> runs_;
  std::vector<Level> levels_;  ///< By StreetKind.
};

}  // namespace livemap::streets
