#pragma once

#include "simulation/objects/counter_random.h"
#include "simulation/objects/mesh.h"

namespace livemap::simulation {

/// A car that stands on the origin of the builder's frame, front towards x. `crushed` of 0..1
/// pushes the front in. Returns its length in metres.
float AddCar(CounterRandom& random, float crushed, MeshBuilder& builder);

}  // namespace livemap::simulation
