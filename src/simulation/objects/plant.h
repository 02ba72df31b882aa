#pragma once

#include "simulation/objects/counter_random.h"
#include "simulation/objects/mesh.h"

namespace livemap::simulation {

/// A broad-leaved tree on the origin of the builder's frame; bare branches without `leaves`.
void AddTree(float height_m, bool leaves, CounterRandom& random, MeshBuilder& builder);

/// A clipped hedge along x from 0 to `length_m`.
void AddHedge(float length_m, float height_m, bool leaves, CounterRandom& random,
              MeshBuilder& builder);

}  // namespace livemap::simulation
