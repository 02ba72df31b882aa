#pragma once

#include "simulation/objects/mesh.h"
#include "simulation/render/lighting.h"
#include "simulation/world/ground_plan.h"

namespace livemap::simulation {

/// Where a ray met a body.
struct SurfacePoint {
  Vec3 position = Vec3::Zero();  ///< World axes, metres.
  Vec3 normal = Vec3::UnitZ();   ///< Unit, towards the viewer.
  Vec3 view = Vec3::UnitX();     ///< Unit, from the viewer to the point.
  Vec2 uv = Vec2::Zero();
  float openness = 1;
  float width_m = 0;  ///< What a pixel covers across the view.
  float stretch = 1;  ///< How many times longer that is along the view, by the slant.
  std::uint32_t instance = 0;
  std::uint32_t patch = 0;  ///< Differs between neighbouring windows.
};

/// How a point looks, before light.
struct Surface {
  Vec3 colour = Vec3(0.5F, 0.5F, 0.5F);  ///< Diffuse reflectance.
  Vec3 normal = Vec3::UnitZ();
  Vec3 glow = Vec3::Zero();
  float sheen = 0;    ///< Share of the sky that it mirrors at a right angle.
  float mirror = 0;   ///< Share of its surroundings that a level film of water mirrors.
  float through = 0;  ///< Share of light that passes from behind (leaves).
  float openness = 1;
  std::uint32_t instance = 0;
};

/// Paints street ground: `point.uv` is (along, left) of the plan's street. `along_share` is how
/// much the view goes along the road: 1 along, 0 across.
Surface PaintGround(const GroundPlan& plan, const SurfacePoint& point, float along_share,
                    const Lighting& lighting);

/// Paints walls, windows, doors and roofs.
Surface PaintHouse(const Material& material, const SurfacePoint& point, const Lighting& lighting);

/// Paints everything else.
Surface PaintObject(const Material& material, const SurfacePoint& point, const Lighting& lighting);

/// Covers what looks up with snow and darkens what is wet.
void ApplyWeather(const SurfacePoint& point, const Lighting& lighting, Surface& surface);

}  // namespace livemap::simulation
