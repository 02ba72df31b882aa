#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>

#include "simulation/render/simulated_camera.h"
#include "simulation/render/street_scene.h"

namespace livemap::simulation {

/// How many pixels each hazard would cover were nothing in front of it, by its instance.
using OutlinePixels = std::map<std::uint32_t, int>;

/// The outlines of all bodies of hazards that a camera at `world_from_optical` has ahead within the
/// scene, cut to the picture. Holes in the road are no bodies: nothing stands for them.
OutlinePixels CountOutlinePixels(const StreetScene& scene, const SimulatedCamera& camera,
                                 const Eigen::Isometry3d& world_from_optical);

}  // namespace livemap::simulation
