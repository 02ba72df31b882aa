#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "simulation/objects/object_class.h"

namespace livemap::simulation {

/// A piece of road: it turns and climbs smoothly over its length.
struct RoadPiece {
  double length_m = 0;
  double turn_deg = 0;  ///< Change of heading, left positive.
  double climb_m = 0;   ///< Change of height, up positive.
};

/// A hazard that a world file places.
struct PlacedHazard {
  ObjectClass object_class = ObjectClass::kPothole;
  double at_m = 0;            ///< Along the road.
  double left_m = 0;          ///< Of the road's middle line; the vehicle's lane is right of it.
  double radius_m = 0;        ///< Of a pothole; 0: drawn by the seed.
  std::optional<bool> water;  ///< In a pothole; none: drawn by the seed.
};

/// Of every road: what a world file may ask for and what a route's corners become.
constexpr double kTightestRadiusM = 48;

/// What a person may decide about a street; everything else follows from the seed.
struct WorldDescription {
  double bearing_deg = 90;                         ///< At the start, clockwise from north.
  std::vector<RoadPiece> pieces;                   ///< Empty: drawn by the seed.
  std::optional<std::vector<double>> crossings_m;  ///< None: drawn by the seed.
  double lane_width_m = 3.25;                      ///< Of each of the two lanes.
  double parking_width_m = 2.1;                    ///< Of the parking lane on each side; 0: none.
  double pavement_width_m = 2.4;
  bool buildings = true;
  bool trees = true;
  bool parked_cars = true;
  std::optional<std::vector<PlacedHazard>> hazards;  ///< None: drawn by the seed.
};

enum class RoadSource { kWorldFile, kRoute };

/// Reads a world from YAML (docs/reference/simulator.md states the keys). Throws Error naming
/// `name`, the line, the key, its value and what is accepted; unknown keys are refused, and
/// 'pieces' and 'bearing_deg' when the road's line comes from a route.
WorldDescription ParseWorldFile(const std::string& yaml, const std::string& name,
                                RoadSource source = RoadSource::kWorldFile);
WorldDescription ReadWorldFile(const std::string& path, RoadSource source = RoadSource::kWorldFile);

}  // namespace livemap::simulation
