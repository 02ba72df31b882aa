#pragma once

#include "simulation/objects/counter_random.h"
#include "simulation/objects/mesh.h"

namespace livemap::simulation {

// Bodies of hazards, on the origin of the builder's frame; their faces look to -x, where the
// vehicle comes from.

/// A cone of about 0.75 m.
void AddTrafficCone(CounterRandom& random, MeshBuilder& builder);
/// A road-work or closure sign on a foot, of about 1.6 m.
void AddWorkSign(CounterRandom& random, MeshBuilder& builder);
/// A barrier of 1.8 m across the road with striped boards and lamps.
void AddBarrier(CounterRandom& random, MeshBuilder& builder);
/// One of: stones, planks, a lost tyre, a carton.
void AddDebris(CounterRandom& random, MeshBuilder& builder);
/// A deer of about 1.1 m at the shoulder, across the road.
void AddDeer(CounterRandom& random, MeshBuilder& builder);
/// A yellow excavator, 2.6 m wide, its boom towards x.
void AddExcavator(CounterRandom& random, MeshBuilder& builder);
/// Two cars that ran into each other, and what fell off.
void AddAccident(CounterRandom& random, MeshBuilder& builder);

}  // namespace livemap::simulation
