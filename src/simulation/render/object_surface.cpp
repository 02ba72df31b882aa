#include <cmath>

#include "simulation/render/surface.h"

namespace livemap::simulation {
namespace {

/// 1 within `half` of the line from `a` to `b`, soft by `footprint`.
float StrokeOnSign(const Vec2& at, const Vec2& a, const Vec2& b, float half, float footprint) {
  const Vec2 way = b - a;
  const float t = Saturate((at - a).dot(way) / way.squaredNorm());
  const float away = (at - a - t * way).norm();
  return 1 - SmoothStep(half - footprint, half + footprint, away);
}

/// A person who digs beside a heap, about the unit square's middle.
float DiggingPersonOnSign(const Vec2& at, float footprint) {
  float ink = 0;
  ink = std::max(ink, StrokeOnSign(at, {0.42F, 0.57F}, {0.43F, 0.58F}, 0.045F, footprint));
  ink = std::max(ink, StrokeOnSign(at, {0.40F, 0.48F}, {0.33F, 0.31F}, 0.045F, footprint));
  ink = std::max(ink, StrokeOnSign(at, {0.33F, 0.31F}, {0.38F, 0.12F}, 0.028F, footprint));
  ink = std::max(ink, StrokeOnSign(at, {0.33F, 0.31F}, {0.26F, 0.12F}, 0.028F, footprint));
  ink = std::max(ink, StrokeOnSign(at, {0.40F, 0.47F}, {0.52F, 0.34F}, 0.022F, footprint));
  ink = std::max(ink, StrokeOnSign(at, {0.44F, 0.42F}, {0.62F, 0.20F}, 0.013F, footprint));
  const float heap = 0.14F - 1.3F * std::abs(at.x() - 0.68F);
  ink = std::max(ink,
                 at.y() > 0.10F ? SmoothStep(-footprint, footprint, heap - (at.y() - 0.10F)) : 0);
  return ink;
}

Vec3 WorkSignSurface(const Material& material, const Vec2& uv, float footprint) {
  // Distance to the nearest edge of the triangle (0,0) (1,0) (0.5,0.87).
  const float side = 0.866F * std::min(uv.x(), 1 - uv.x()) - 0.5F * uv.y();
  const float border = std::min(uv.y(), side);
  const float ring = 1 - SmoothStep(0.085F - footprint, 0.085F + footprint, border);
  const Vec3 plate = Blend(material.colour, material.accent, ring);
  const Vec2 inside((uv.x() - 0.5F) * 1.45F + 0.47F, (uv.y() - 0.06F) * 1.35F);
  return Blend(plate, Vec3(0.02F, 0.02F, 0.02F),
               (1 - ring) * DiggingPersonOnSign(inside, 1.4F * footprint));
}

Vec3 DiamondSignSurface(const Material& material, const Vec2& uv, float footprint) {
  const float border = std::min(std::min(uv.x(), 1 - uv.x()), std::min(uv.y(), 1 - uv.y()));
  const float line = FilteredBand(0.03F, 0.055F, border, footprint);
  // The plate stands on its corner: the picture is turned back by an eighth.
  const Vec2 c = uv - Vec2(0.5F, 0.5F);
  const Vec2 upright(0.5F + 0.95F * (c.x() - c.y()), 0.34F + 0.95F * (c.x() + c.y()));
  const float ink = std::max(line, DiggingPersonOnSign(upright, 1.3F * footprint));
  return Blend(material.colour, material.accent, ink);
}

Vec3 RoadClosedSurface(const Material& material, const Vec2& uv, float footprint) {
  const float r = 2 * (uv - Vec2(0.5F, 0.5F)).norm();
  const bool no_entry = (material.seed & 1U) != 0;
  if (no_entry) {
    const float bar = FilteredBand(0.40F, 0.60F, uv.y(), footprint) *
                      FilteredBand(0.14F, 0.86F, uv.x(), footprint);
    return Blend(material.accent, material.colour, std::max(bar, r > 0.96F ? 1.0F : 0.0F));
  }
  return Blend(material.colour, material.accent,
               SmoothStep(0.72F - footprint, 0.72F + footprint, r));
}

Vec3 TrafficSignSurface(const Material& material, const Vec2& uv, float footprint) {
  const float r = 2 * (uv - Vec2(0.5F, 0.5F)).norm();
  const Vec3 blue(0.02F, 0.09F, 0.38F);
  const Vec3 red(0.50F, 0.02F, 0.02F);
  if (material.seed % 3 == 0) {
    const float stroke = StrokeOnSign(uv, {0.22F, 0.78F}, {0.78F, 0.22F}, 0.06F, footprint);
    const float ring = SmoothStep(0.78F - footprint, 0.78F + footprint, r);
    return Blend(blue, red, std::max(stroke, ring));
  }
  if (material.seed % 3 == 1) {
    const float ring = SmoothStep(0.74F - footprint, 0.74F + footprint, r);
    const float three =
        std::max(StrokeOnSign(uv, {0.36F, 0.38F}, {0.36F, 0.62F}, 0.035F, footprint),
                 StrokeOnSign(uv, {0.56F, 0.38F}, {0.64F, 0.62F}, 0.05F, footprint));
    return Blend(Blend(material.colour, red, ring), Vec3(0.02F, 0.02F, 0.02F), three);
  }
  const float arrow =
      std::max(StrokeOnSign(uv, {0.5F, 0.2F}, {0.5F, 0.75F}, 0.05F, footprint),
               std::max(StrokeOnSign(uv, {0.5F, 0.78F}, {0.32F, 0.58F}, 0.05F, footprint),
                        StrokeOnSign(uv, {0.5F, 0.78F}, {0.68F, 0.58F}, 0.05F, footprint)));
  return Blend(blue, material.colour, std::max(arrow, r > 0.94F ? 1.0F : 0.0F));
}

Vec3 ConeSurface(const Material& material, const SurfacePoint& point, float footprint) {
  const float v = point.uv.y();
  const float band =
      FilteredBand(0.33F, 0.46F, v, footprint) + FilteredBand(0.54F, 0.64F, v, footprint);
  const float dirt = FractalNoise(point.uv.x() * 3, v, 0.2F, 3, footprint, material.seed);
  const float low = 1 - SmoothStep(0.03F, 0.3F, v);
  return Blend(material.colour, material.accent, std::min(1.0F, band)) *
         (1 - 0.10F * dirt - 0.28F * low * (0.6F + dirt));
}

Vec3 CarSurface(const Material& material, const SurfacePoint& point, float footprint) {
  Vec3 colour = material.colour;
  const float dust =
      (1 - SmoothStep(0.25F, 0.75F, point.uv.y())) *
      (0.5F + 0.5F * FractalNoise(point.uv.x(), point.uv.y(), 0.4F, 3, footprint, material.seed));
  colour = Blend(colour, Vec3(0.12F, 0.11F, 0.10F), 0.45F * dust);
  float gaps = 0;
  if (std::abs(point.normal.z()) < 0.75F) {
    for (const float x : {-0.82F, 0.22F, 1.02F}) {
      gaps = std::max(gaps, FilteredBand(-0.007F, 0.007F, point.uv.x() - x, footprint));
    }
    gaps *= point.uv.y() > 0.3F ? 1.0F : 0.0F;
  }
  return colour * (1 - 0.75F * gaps);
}

Vec3 PlantSurface(const Material& material, const SurfacePoint& point, float size,
                  float footprint) {
  const float rough =
      FractalNoise(point.uv.x(), point.uv.y() * 0.45F, size, 4, footprint, material.seed);
  return material.colour * (1 + 0.75F * rough);
}

}  // namespace

Surface PaintObject(const Material& material, const SurfacePoint& point, const Lighting& lighting) {
  const float footprint = point.width_m * std::sqrt(std::min(point.stretch, 4.0F));
  Surface surface;
  surface.colour = material.colour;
  surface.normal = point.normal;
  surface.openness = point.openness;
  surface.instance = point.instance;
  switch (material.kind) {
    case MaterialKind::kBark:
      surface.colour = PlantSurface(material, point, 0.09F, footprint);
      break;
    case MaterialKind::kHedge:
      surface.colour = PlantSurface(material, point, 0.12F, footprint);
      surface.openness *= 0.6F;
      break;
    case MaterialKind::kLeaf: {
      const float own = UnitFloat(HashBits(point.patch + material.seed));
      surface.colour = Blend(material.accent, material.colour * 1.35F, own);
      surface.through = 0.45F;
      break;
    }
    case MaterialKind::kFur:
      surface.colour =
          Blend(material.colour * (1 + 0.3F * FractalNoise(point.uv.x(), point.uv.y(), 0.05F, 3,
                                                           footprint, material.seed)),
                material.accent, 0.35F * Saturate(-point.normal.z()));
      break;
    case MaterialKind::kWood:
      surface.colour = PlantSurface(material, point, 0.12F, footprint);
      break;
    case MaterialKind::kMetal:
      surface.sheen = 0.18F;
      break;
    case MaterialKind::kCarPaint:
      surface.colour = CarSurface(material, point, footprint);
      surface.sheen = 0.07F;
      break;
    case MaterialKind::kCarGlass:
      surface.sheen = 0.11F;
      break;
    case MaterialKind::kRubber:
      surface.sheen = 0.01F;
      break;
    case MaterialKind::kCone:
      surface.colour = ConeSurface(material, point, footprint);
      surface.sheen = 0.02F;
      break;
    case MaterialKind::kStripes: {
      const float across = point.uv.x() + point.uv.y();
      surface.colour = Blend(material.colour, material.accent,
                             FilteredStripes(0.22F, 0.44F, across + 50, 1.4F * footprint));
      break;
    }
    case MaterialKind::kWorkSign:
      surface.colour = WorkSignSurface(material, point.uv, footprint);
      break;
    case MaterialKind::kDiamondSign:
      surface.colour = DiamondSignSurface(material, point.uv, footprint);
      break;
    case MaterialKind::kClosedSign:
      surface.colour = RoadClosedSurface(material, point.uv, 1.4F * footprint);
      break;
    case MaterialKind::kTrafficSign:
      surface.colour = TrafficSignSurface(material, point.uv, 1.6F * footprint);
      break;
    case MaterialKind::kLight: {
      const bool on = lighting.lit_windows > 0;
      surface.colour = material.colour * 0.6F;
      if (on)
        surface.glow = material.colour * (lighting.condition == Condition::kDusk ? 3.0F : 0.9F);
      break;
    }
    default:
      break;
  }
  return surface;
}

void ApplyWeather(const SurfacePoint& point, const Lighting& lighting, Surface& surface) {
  const float up = point.normal.z();
  if (lighting.wetness > 0.5F) {
    surface.colour *= surface.through > 0 ? 0.85F : 0.74F;
    surface.sheen += 0.025F;
  }
  if (lighting.snow > 0 && up > 0.25F) {
    const float rough = FractalNoise(point.position.x(), point.position.y(), 0.35F, 3,
                                     point.width_m, lighting.seed + 9);
    const float cover = SmoothStep(0.32F, 0.6F, up + 0.25F * rough) * lighting.snow;
    surface.colour = Blend(surface.colour, Vec3(0.86F, 0.88F, 0.92F), 0.94F * cover);
    surface.sheen *= 1 - cover;
    surface.glow *= 1 - cover;
  }
}

}  // namespace livemap::simulation
