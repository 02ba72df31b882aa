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
  /// In 1e-7 degrees.
  struct Box {
    std::int32_t south = INT32_MAX;
    std::int32_t west = INT32_MAX;
    std::int32_t north = INT32_MIN;
    std::int32_t east = INT32_MIN;

    void Include(const Box& other);
  };
  /// Segments of one street that follow each other.
  struct Run {
    std::uint32_t first;
    std::uint32_t count;
    Box box;
  };
  /// Runs of one name and class that go on in each other: mappers cut streets into short ways, and
  /// from afar a line with two points for each of them is far too much.
  struct Chain {
    std::uint32_t begin;  ///< In parts_.
    std::uint32_t end;
    Box box;
  };
  /// A run of a chain and whether it is passed against its order.
  struct Part {
    std::uint32_t run;
    bool reversed;
  };
  /// What lies where, by number.
  struct Index {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> cells;  ///< Key and number, sorted.
    std::vector<std::uint32_t> large;                            ///< Over very many cells.

    void Add(std::uint32_t number, const Box& box);
    void Sort();
    /// Those that may lie in a box, each once.
    std::vector<std::uint32_t> In(const Box& box) const;
  };
  /// Which end of which run goes on at an end of a run; by 2 * run + (1 for its last node).
  using Joints = std::vector<std::uint32_t>;

  void AddRun(std::uint32_t first, std::uint32_t end);
  Joints FindJoints() const;
  void AddChains();
  void AddPoints(const Run& run, bool reversed, std::vector<geo::GeoPoint>& points) const;

  const StreetMap& map_;
  std::vector<Run> runs_;
  std::vector<Index> run_index_;  ///< By StreetKind.
  std::vector<Chain> chains_;     ///< Of the classes that are drawn from afar.
  std::vector<Part> parts_;
  std::vector<Index> chain_index_;  ///< By StreetKind.
};

}  // namespace livemap::streets
