#pragma once

#include <cstdint>

#include "simulation/objects/counter_random.h"
#include "simulation/objects/mesh.h"

namespace livemap::simulation {

/// Builds a house into the builder's frame: x along the street, the front in the plane y = 0
/// facing -y, z up from the pavement; it fills x in [0, width_m] and y in [0, depth_m].
void AddBuilding(float width_m, float depth_m, CounterRandom& random, MeshBuilder& builder);

}  // namespace livemap::simulation
