#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "simulation/objects/mesh.h"
#include "simulation/world/ground_plan.h"
#include "simulation/world/road_line.h"
#include "simulation/world/street_change.h"
#include "simulation/world/world_file.h"

namespace livemap::simulation {

/// A street is built block by block, so that a long drive needs no more memory than a short one.
constexpr double kBlockM = 40;

/// A hazard of the street, where it truly is.
struct StreetHazard {
  ObjectClass object_class = ObjectClass::kPothole;
  double along_m = 0;
  double left_m = 0;    ///< Of the road's middle line.
  double radius_m = 0;  ///< Of its footprint, about.
  bool water = false;   ///< A pothole with water in it.
  std::uint64_t seed = 0;
  std::uint32_t instance = 0;
};

/// The bodies of one block. Positions are relative to `origin` (world frame, metres).
struct StreetBlock {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Mesh mesh;
  GroundPlan ground;
  std::vector<Vec3> lamps;            ///< Lights of the lamp posts.
  std::vector<StreetChange> changes;  ///< What only one of two passes shows, here or not.
};

/// A street in town with everything that stands in it, a pure function of the description, the
/// seed, the season and the pass. Two passes of one street differ in their changes alone: all else
/// stands in the same place under the same instance id, in any season. Immutable: any thread may
/// ask.
class Street {
 public:
  /// Lays road for at least `length_m`. `leaves`: trees are green.
  Street(const WorldDescription& description, std::uint64_t seed, double length_m, bool leaves,
         const StreetPass& pass = StreetPass());

  const RoadLine& line() const { return line_; }
  const WorldDescription& description() const { return description_; }
  const StreetProfile& profile() const { return profile_; }
  std::uint64_t seed() const { return seed_; }
  const StreetPass& pass() const { return pass_; }
  /// Middle of the lane that the vehicle drives in, metres left of the middle line.
  double lane_left_m() const { return -0.5 * description_.lane_width_m; }

  /// Of block `index`, which spans [index, index + 1) * kBlockM; those that this pass lacks too.
  std::vector<StreetHazard> Hazards(int index) const;
  StreetBlock Build(int index) const;
  /// Middles of the crossing roads of block `index`, metres along the road.
  std::vector<double> Crossings(int index) const;

 private:
  friend class BlockBuilder;
  GroundPlan PlanGround(int index) const;

  WorldDescription description_;
  std::uint64_t seed_;
  bool leaves_;
  StreetPass pass_;
  RoadLine line_;
  StreetProfile profile_;
};

}  // namespace livemap::simulation
