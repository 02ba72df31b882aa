#pragma once

#include "simulation/objects/mesh.h"
#include "simulation/world/ground_plan.h"
#include "simulation/world/road_line.h"

namespace livemap::simulation {

/// Lays the ground from `begin_m` to `end_m` along the road: road with crown and potholes, kerbs,
/// pavements, gardens, side roads. Positions are relative to `origin`. Uses the builder's current
/// material, which is of kind kGround.
void AddGround(const RoadLine& line, const GroundPlan& plan, double begin_m, double end_m,
               const Eigen::Vector3d& origin, MeshBuilder& builder);

/// Height of the undamaged ground over the middle line, metres.
float GroundHeight(const GroundPlan& plan, float along_m, float left_m);

}  // namespace livemap::simulation
