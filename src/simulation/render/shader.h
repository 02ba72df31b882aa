#pragma once

#include "simulation/render/lighting.h"
#include "simulation/render/street_scene.h"
#include "simulation/render/surface.h"

namespace livemap::simulation {

/// Lights what rays meet. Immutable after construction: any thread may ask. Positions are relative
/// to the scene's origin.
class Shader {
 public:
  /// `eye` and `forward` (unit) are the vehicle's camera: its headlights shine from there.
  Shader(const StreetScene& scene, const Lighting& lighting, const Vec3& eye, const Vec3& forward);

  /// Radiances along up to eight neighbouring rays from the eye; `directions` need not be unit
  /// vectors, `pixel_angle` is what a pixel spans, radians. `instances`, if given, receives what
  /// was met.
  void Radiances(const Vec3* directions, const SceneHit* hits, int count, float pixel_angle,
                 Vec3* radiances, std::uint32_t* instances) const;

 private:
  SurfacePoint PointAt(const Vec3& from, const Vec3& direction, const SceneHit& hit,
                       float pixel_angle, const Material** material) const;
  Surface Paint(const SurfacePoint& point, const Material& material,
                const StreetScene::Block& block) const;
  /// In which of the points' light the sun could be, and is: one bit each.
  unsigned Sunlit(const SurfacePoint* points, const Material* const* materials, int count) const;
  Vec3 Radiance(const SurfacePoint& point, const Material& material, const SceneHit& hit,
                bool sunlit, std::uint32_t* instance) const;
  Vec3 Sheen(const SurfacePoint& point, const Surface& surface, float grazing, bool sunlit) const;
  Vec3 Light(const SurfacePoint& point, const Surface& surface, bool is_leaf, bool sunlit) const;
  Vec3 Lamps(const SurfacePoint& point, const Vec3& normal) const;
  Vec3 Mirrored(const SurfacePoint& point, const Surface& surface) const;
  Vec3 ThroughAir(const Vec3& radiance, float distance) const;

  const StreetScene& scene_;
  const Lighting& lighting_;
  Vec3 eye_;
  Vec3 forward_;
  std::vector<Vec3> lamps_;
};

}  // namespace livemap::simulation
