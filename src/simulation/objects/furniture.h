#pragma once

#include "simulation/objects/counter_random.h"
#include "simulation/objects/mesh.h"

namespace livemap::simulation {

// Things that stand in every street, on the origin of the builder's frame.

/// A lamp post whose arm reaches to -y; returns the height of its light over the origin.
float AddLampPost(MeshBuilder& builder);
/// Where its light hangs, y.
constexpr float kLampReachM = -1.3F;

/// An ordinary traffic sign on a post, facing -x.
void AddTrafficSign(CounterRandom& random, MeshBuilder& builder);
/// A railing or picket fence along x from 0 to `length_m`.
void AddFence(float length_m, CounterRandom& random, MeshBuilder& builder);
void AddBin(CounterRandom& random, MeshBuilder& builder);
void AddRubbishBags(CounterRandom& random, MeshBuilder& builder);
/// A standing or walking person of about 1.75 m, facing x.
void AddPerson(CounterRandom& random, MeshBuilder& builder);
/// A bench, a planter or a post box along x, its front to -y.
void AddOtherObject(CounterRandom& random, MeshBuilder& builder);
/// A bicycle along x that leans to y on a stand.
void AddBicycle(CounterRandom& random, MeshBuilder& builder);

}  // namespace livemap::simulation
