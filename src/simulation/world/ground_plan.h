#pragma once

#include <cstdint>
#include <vector>

#include "simulation/objects/noise.h"

namespace livemap::simulation {

/// The cross-section of a street, metres; both sides are alike.
struct StreetProfile {
  float lane_width_m = 3.25F;
  float parking_width_m = 2.1F;
  float pavement_width_m = 2.4F;
  float half_road_m() const { return lane_width_m + parking_width_m; }
};

constexpr float kKerbWidthM = 0.15F;
constexpr float kKerbHeightM = 0.12F;
constexpr float kCrownFall = 0.02F;         ///< The road falls from its middle by this slope.
constexpr float kSideRoadHalfM = 3.4F;      ///< Half the width of a crossing road.
constexpr float kCornerRadiusM = 4.5F;      ///< Of the kerb where two roads meet.
constexpr float kGroundHalfWidthM = 46.0F;  ///< The street's ground ends there.

/// A hole in the asphalt with a worn, irregular edge. `along` and `left` as everywhere: metres
/// along the road and left of its middle line.
struct Pothole {
  float along_m = 0;
  float left_m = 0;
  float radius_m = 0.4F;  ///< Mean.
  float depth_m = 0.07F;
  float water_m = 0;  ///< Height of the water over the deepest point; 0: dry.
  std::uint32_t seed = 0;
  std::uint32_t instance = 0;
  std::uint64_t id = 0;  ///< Of the hazard.

  /// Distance from the centre over the outline's radius in that direction: below 1 inside.
  float Reach(float along, float left) const;
  /// Height of the dent's surface at a place, at most 0; water not regarded.
  float Dent(float along, float left) const;
  /// Height of the water's surface, below 0; -1: dry.
  float WaterLevel() const { return water_m > 0 ? -depth_m + water_m : -1.0F; }
};

struct Manhole {
  float along_m = 0;
  float left_m = 0;
  float radius_m = 0.33F;
  std::uint32_t seed = 0;
};

/// A dip of the road in which rain stands; nothing else in dry weather than a smooth darker place.
struct Repair {
  Vec2 low = Vec2::Zero();  ///< (along, left)
  Vec2 high = Vec2::Zero();
  std::uint32_t seed = 0;
};

/// What the ground near one block of street is made of. `along` counts from the world's start.
struct GroundPlan {
  StreetProfile profile;
  std::uint32_t seed = 0;
  std::vector<float> crossings_m;
  std::vector<Pothole> potholes;
  std::vector<Manhole> manholes;
  std::vector<Repair> repairs;

  /// Distance from the middle line to the kerb's foot; `crossing` is set to the signed distance
  /// along the road to the nearest crossing's middle (1e9 when none is near).
  float KerbFoot(float along, float* crossing) const;
};

}  // namespace livemap::simulation
