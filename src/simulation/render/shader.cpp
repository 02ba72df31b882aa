#include "simulation/render/shader.h"

#include <cmath>
#include <limits>

namespace livemap::simulation {
namespace {

constexpr float kLampReachSquared = 22.0F * 22.0F;

bool IsShadedAsHouse(MaterialKind kind) {
  switch (kind) {
    case MaterialKind::kBrick:
    case MaterialKind::kPlaster:
    case MaterialKind::kConcrete:
    case MaterialKind::kRoofTiles:
    case MaterialKind::kWindow:
    case MaterialKind::kShopWindow:
    case MaterialKind::kDoor:
      return true;
    default:
      return false;
  }
}

}  // namespace

Shader::Shader(const StreetScene& scene, const Lighting& lighting, const Vec3& eye,
               const Vec3& forward)
    : scene_(scene), lighting_(lighting), eye_(eye), forward_(forward) {
  if (lighting.lamps.x() <= 0) return;
  for (const auto& block : scene.visible()) {
    for (const Vec3& lamp : block->street.lamps) lamps_.push_back(lamp + block->offset);
  }
}

SurfacePoint Shader::PointAt(const Vec3& from, const Vec3& direction, const SceneHit& hit,
                             float pixel_angle, const Material** material) const {
  const Mesh& mesh = scene_.block(hit.block).street.mesh;
  const Triangle& triangle = mesh.triangles[hit.triangle];
  const std::uint32_t* c = triangle.corners;
  const float w = 1 - hit.u - hit.v;
  SurfacePoint point;
  point.position = from + hit.distance * direction;
  point.normal = (w * mesh.normals[c[0]] + hit.u * mesh.normals[c[1]] + hit.v * mesh.normals[c[2]])
                     .normalized();
  point.uv = w * mesh.uvs[c[0]] + hit.u * mesh.uvs[c[1]] + hit.v * mesh.uvs[c[2]];
  point.openness =
      w * mesh.openness[c[0]] + hit.u * mesh.openness[c[1]] + hit.v * mesh.openness[c[2]];
  const float length = direction.norm();
  point.view = direction / length;
  const float facing = point.normal.dot(point.view);
  if (facing > 0) point.normal = -point.normal;
  point.width_m = pixel_angle * hit.distance * length;
  point.stretch = 1.0F / std::max(std::abs(facing), 0.02F);
  point.instance = triangle.instance;
  // Both halves of a quad begin at the same corner.
  point.patch = c[0];
  *material = &mesh.materials[triangle.material];
  return point;
}

Surface Shader::Paint(const SurfacePoint& point, const Material& material,
                      const StreetScene::Block& block) const {
  if (material.kind == MaterialKind::kGround) {
    const Vec2 view = Vec2(point.view.x(), point.view.y()).normalized();
    Surface surface =
        PaintGround(block.street.ground, point, std::abs(view.dot(block.heading)), lighting_);
    const float begin =
        std::floor(point.uv.x() / static_cast<float>(kBlockM)) * static_cast<float>(kBlockM);
    surface.openness *= StreetScene::SkyOverGround(block, point.uv.x() - begin, point.uv.y());
    return surface;
  }
  Surface surface = IsShadedAsHouse(material.kind) ? PaintHouse(material, point, lighting_)
                                                   : PaintObject(material, point, lighting_);
  ApplyWeather(point, lighting_, surface);
  return surface;
}

Vec3 Shader::Lamps(const SurfacePoint& point, const Vec3& normal) const {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& lamp : lamps_) {
    const Vec3 to = lamp - point.position;
    const float squared = to.squaredNorm();
    if (squared > kLampReachSquared) continue;
    const float inverse = 1.0F / std::sqrt(squared);
    const float lambert = std::max(0.0F, normal.dot(to) * inverse);
    const float downwards = SmoothStep(0.05F, 0.55F, to.z() * inverse);
    const float fade = 1 - squared / kLampReachSquared;
    sum += lighting_.lamps * (lambert * downwards * fade / (squared + 0.5F));
  }
  if (lighting_.headlights.x() > 0) {
    const Vec3 lamp = eye_ - Vec3(0, 0, 0.65F);
    const Vec3 from = point.position - lamp;
    const float squared = from.squaredNorm();
    const Vec3 way = from / std::sqrt(squared);
    const float side = way.x() * forward_.y() - way.y() * forward_.x();
    const float ahead = way.dot(forward_);
    const float beam = SmoothStep(0.80F, 0.99F, ahead) * (1 - SmoothStep(0.0F, 0.055F, way.z())) *
                       (1 - SmoothStep(0.25F, 0.55F, std::abs(side)));
    // Low beams spare the ground right before the car.
    const float steep = 1 - 0.85F * SmoothStep(0.07F, 0.30F, -way.z());
    const float lambert = steep * std::max(0.12F, -normal.dot(way));
    sum += lighting_.headlights * (beam * lambert * 6.0F / (squared + 30.0F));
  }
  return sum;
}

unsigned Shader::Sunlit(const SurfacePoint* points, const Material* const* materials,
                        int count) const {
  if (lighting_.sun.x() <= 0) return 0;
  Vec3 starts[8];
  unsigned facing = 0;
  for (int i = 0; i < count; ++i) {
    if (materials[i] == nullptr) continue;
    const bool is_leaf = materials[i]->kind == MaterialKind::kLeaf;
    if (!is_leaf && points[i].normal.dot(lighting_.sun_direction) <= 0) continue;
    starts[i] = points[i].position + 0.006F * (is_leaf ? Vec3(-points[i].view) : points[i].normal);
    facing |= 1U << static_cast<unsigned>(i);
  }
  return facing & ~scene_.BlockedOfEight(starts, facing, lighting_.sun_direction, 90);
}

Vec3 Shader::Light(const SurfacePoint& point, const Surface& surface, bool is_leaf,
                   bool sunlit) const {
  const Vec3& n = surface.normal;
  const float up = 0.5F + 0.5F * n.z();
  Vec3 light = (lighting_.ambient * up + lighting_.bounce * (1 - up)) * surface.openness;
  if (sunlit) {
    float facing = n.dot(lighting_.sun_direction);
    if (surface.through > 0) facing = std::max(facing, -surface.through * facing);
    const float depth = is_leaf ? 0.35F + 0.65F * surface.openness : 1.0F;
    light += lighting_.sun * (std::max(facing, 0.0F) * depth);
  }
  if (lighting_.lamps.x() > 0 || lighting_.headlights.x() > 0) light += Lamps(point, n);
  return light;
}

Vec3 Shader::Mirrored(const SurfacePoint& point, const Surface& surface) const {
  const Vec3 way = (point.view - 2 * point.view.dot(surface.normal) * surface.normal).normalized();
  const Vec3 start = point.position + 0.01F * point.normal;
  const SceneHit hit = scene_.Cast(start, way, 0.0F, 80);
  if (!hit.found) return SmoothSky(lighting_, way);
  const Material* material = nullptr;
  SurfacePoint seen = PointAt(start, way, hit, 0.02F, &material);
  const StreetScene::Block& block = scene_.block(hit.block);
  if (material->kind == MaterialKind::kGround) {
    return ThroughAir(Vec3(0.1F, 0.1F, 0.1F).cwiseProduct(lighting_.ambient), hit.distance);
  }
  const Surface there = Paint(seen, *material, block);
  const Vec3 light = lighting_.ambient * (0.7F * there.openness) + 0.35F * lighting_.sun;
  return ThroughAir(there.colour.cwiseProduct(light) + there.glow, hit.distance);
}

Vec3 Shader::ThroughAir(const Vec3& radiance, float distance) const {
  return Blend(lighting_.haze, radiance, std::exp(-distance / lighting_.haze_m));
}

void Shader::Radiances(const Vec3* directions, const SceneHit* hits, int count, float pixel_angle,
                       Vec3* radiances, std::uint32_t* instances) const {
  SurfacePoint points[8];
  const Material* materials[8] = {};
  for (int i = 0; i < count; ++i) {
    if (hits[i].found) {
      points[i] = PointAt(eye_, directions[i], hits[i], pixel_angle, &materials[i]);
    }
  }
  const unsigned sunlit = Sunlit(points, materials, count);
  for (int i = 0; i < count; ++i) {
    std::uint32_t instance = MakeInstance(0, ObjectClass::kSky);
    if (materials[i] == nullptr) {
      const Vec3 way = directions[i].normalized();
      radiances[i] =
          way.z() < 0 ? Blend(lighting_.haze, lighting_.bounce, 0.3F) : SkyRadiance(lighting_, way);
    } else {
      const bool in_sun = (sunlit >> static_cast<unsigned>(i) & 1U) != 0;
      radiances[i] = ThroughAir(Radiance(points[i], *materials[i], hits[i], in_sun, &instance),
                                hits[i].distance * directions[i].norm());
    }
    if (instances != nullptr) instances[i] = instance;
  }
}

Vec3 Shader::Sheen(const SurfacePoint& point, const Surface& surface, float grazing,
                   bool sunlit) const {
  const Vec3 way = point.view - 2 * point.view.dot(surface.normal) * surface.normal;
  const float share =
      surface.sheen + (1 - surface.sheen) * grazing * std::min(1.0F, 6 * surface.sheen);
  // Low directions meet the houses across the street rather than the sky.
  const float sky = SmoothStep(0.08F, 0.42F, way.z());
  const Vec3 houses = Vec3(0.22F, 0.20F, 0.18F).cwiseProduct(lighting_.ambient);
  Vec3 light = share * surface.openness * Blend(houses, SmoothSky(lighting_, way), sky);
  if (sunlit && surface.sheen > 0.05F) {
    const float glint = std::max(0.0F, way.dot(lighting_.sun_direction));
    light += lighting_.sun * (share * 9 * std::pow(glint, 180.0F));
  }
  return light;
}

Vec3 Shader::Radiance(const SurfacePoint& point, const Material& material, const SceneHit& hit,
                      bool sunlit, std::uint32_t* instance) const {
  const Surface surface = Paint(point, material, scene_.block(hit.block));
  *instance = surface.instance;
  const bool is_leaf = material.kind == MaterialKind::kLeaf;
  Vec3 radiance = surface.colour.cwiseProduct(Light(point, surface, is_leaf, sunlit));
  // Fresnel's law after Schlick: flat views mirror more.
  const float away = 1 - std::max(0.0F, -point.view.dot(surface.normal));
  const float grazing = away * away * away * away * away;
  if (surface.mirror > 0.02F) {
    const float share = surface.mirror * (0.03F + 0.97F * grazing);
    if (share > 0.012F) radiance = Blend(radiance, Mirrored(point, surface), share);
  }
  if (surface.sheen > 0) radiance += Sheen(point, surface, grazing, sunlit);
  return radiance + surface.glow;
}

}  // namespace livemap::simulation
