#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "geo/wgs84.h"
#include "streets/street_map.h"

namespace livemap::tools {

/// A street of simulated traffic as a map has it: the middle of its carriageway.
struct TrafficStreet {
  std::vector<Eigen::Vector2d> line_m;  ///< East, north; a point about every metre.
  bool one_way = false;                 ///< In the order of the points.
  int lanes = 2;
  bool bridge = false;
  bool roundabout = false;
};

/// What a map of them gets wrong.
struct StreetMapErrors {
  double node_least_m = 1;  ///< Each node lies so far off, in any direction, at least...
  double node_most_m = 2;   ///< ...and at most.
  double absent_share =
      0.02;  ///< Of the pieces of streets: to the next junction, some 500 m at most.
  double no_lanes_share = 0.5;  ///< Of the pieces: their lanes are not told.
};

/// The map that somebody drew of the streets: nodes where the line bends by more than half a metre
/// and every 100 m, streets cut at `junctions_m`, where they share a node, and the errors. It has
/// no names, so that it does not tell which street goes on. The same seed gives the same map.
std::shared_ptr<const streets::StreetMap> DrawStreetMap(
    const std::vector<TrafficStreet>& streets, const std::vector<Eigen::Vector2d>& junctions_m,
    const geo::LocalFrame& frame, const StreetMapErrors& errors, std::uint64_t seed);

}  // namespace livemap::tools
