#include <cmath>

#include "simulation/render/surface.h"

namespace livemap::simulation {
namespace {

float HouseFootprint(const SurfacePoint& point) {
  return point.width_m * std::sqrt(std::min(point.stretch, 6.0F));
}

/// Rain and dirt run down walls and splash up from the pavement.
float HouseStains(const SurfacePoint& point, std::uint32_t seed, float footprint) {
  const float streaks =
      FractalNoise(point.uv.x() * 2.5F, point.uv.y() * 0.35F, 1.0F, 2, footprint * 2, seed + 3);
  const float splash = 1 - SmoothStep(0.0F, 0.9F, point.uv.y());
  return 1 + 0.16F * streaks - 0.22F * splash;
}

Vec3 HouseBrick(const Material& material, const SurfacePoint& point, float footprint) {
  constexpr float kLength = 0.225F;
  constexpr float kHeight = 0.075F;
  const float row = std::floor(point.uv.y() / kHeight);
  const float shifted = point.uv.x() + (std::fmod(std::abs(row), 2.0F) > 0.5F ? 0.5F * kLength : 0);
  const float mortar = std::max(FilteredStripes(0.011F, kLength, shifted, footprint),
                                FilteredStripes(0.011F, kHeight, point.uv.y(), footprint));
  const std::uint32_t brick =
      HashLattice(FloorToInt(shifted / kLength), static_cast<std::int32_t>(row), material.seed);
  const float own = DetailLeft(0.15F, footprint) * (UnitFloat(brick) - 0.5F);
  const float burnt = UnitFloat(HashBits(brick)) > 0.9F ? DetailLeft(0.15F, footprint) * 0.35F : 0;
  const float rough =
      FractalNoise(point.uv.x(), point.uv.y(), 0.03F, 2, footprint, material.seed + 1);
  const Vec3 clay = material.colour * (1 + 0.5F * own - burnt + 0.15F * rough);
  return Blend(clay, Vec3(0.40F, 0.38F, 0.35F), 0.8F * mortar);
}

Vec3 HousePlaster(const Material& material, const SurfacePoint& point, float footprint) {
  const float wide = FractalNoise(point.uv.x(), point.uv.y(), 2.2F, 3, footprint, material.seed);
  const float fine = DetailLeft(0.012F, footprint) *
                     Noise(point.uv.x() / 0.008F, point.uv.y() / 0.008F, material.seed + 2);
  return material.colour * (1 + 0.10F * wide + 0.12F * fine);
}

Vec3 HouseRoofTiles(const Material& material, const SurfacePoint& point, float footprint) {
  constexpr float kRow = 0.32F;
  constexpr float kTile = 0.25F;
  const float row = std::floor(point.uv.y() / kRow);
  const float in_row = point.uv.y() / kRow - row;
  const float shifted = point.uv.x() + (std::fmod(std::abs(row), 2.0F) > 0.5F ? 0.5F * kTile : 0);
  const std::uint32_t tile =
      HashLattice(FloorToInt(shifted / kTile), static_cast<std::int32_t>(row), material.seed);
  const float seen = DetailLeft(kTile, footprint);
  const float wave = std::cos(6.2832F * shifted / kTile);
  float tone = 1 + seen * (0.35F * (UnitFloat(tile) - 0.5F) + 0.22F * wave -
                           0.45F * SmoothStep(0.86F, 1.0F, in_row));
  tone *=
      1 + 0.2F * FractalNoise(point.uv.x(), point.uv.y(), 3.0F, 4, footprint, material.seed + 4);
  return material.colour * tone;
}

/// Frame and glazing bars of a pane whose uv runs over 0..1; 1 on wood.
float HouseWindowFrame(const Vec2& uv, int columns, int rows, float border, float footprint) {
  const auto bars = [&](float x, int count) {
    const float cells = static_cast<float>(count);
    const float from_bar = std::abs(x * cells - std::round(x * cells)) / cells;
    const bool edge = x < 0.5F / cells || x > 1 - 0.5F / cells;
    const float half = edge ? border : 0.55F * border;
    return 1 - SmoothStep(half - footprint, half + footprint, from_bar);
  };
  return std::max(bars(uv.x(), columns), bars(uv.y(), rows));
}

/// A room behind glass: darkness, curtains, at night light.
Surface HouseRoom(const Material& material, const SurfacePoint& point, const Lighting& lighting,
                  bool shop) {
  Surface surface;
  const std::uint32_t window = HashBits(point.patch * 2654435761U + material.seed);
  const float kind = UnitFloat(window);
  const float u = point.uv.x();
  const float v = point.uv.y();
  // Deeper parts of the room shift against the frame as the viewer moves.
  const float shift = 0.25F * point.view.x() + 0.25F * point.view.y();
  Vec3 inside = Vec3(0.035F, 0.034F, 0.033F) *
                (1 + 0.5F * Noise((u + shift) * 5, (v + point.view.z()) * 5, window));
  float curtain = 0;
  if (!shop) {
    const float width = 0.16F + 0.22F * UnitFloat(HashBits(window + 1));
    const float fold = 0.85F + 0.15F * std::sin(60 * u);
    if (kind < 0.5F) curtain = (u < width || u > 1 - width) ? fold : 0;
    if (kind > 0.8F) curtain = v > UnitFloat(HashBits(window + 2)) ? 0.9F : 0;
    inside = Blend(inside, Vec3(0.42F, 0.39F, 0.34F), 0.75F * curtain);
  } else {
    const float shelf =
        Noise((u + shift) * 9, v * 4, window) + 0.6F * Noise(u * 23, v * 11, window + 1);
    const Vec3 goods(0.06F + 0.2F * UnitFloat(HashBits(window + 3)), 0.10F,
                     0.05F + 0.15F * UnitFloat(HashBits(window + 4)));
    inside = Blend(inside, goods, Saturate(1.4F * shelf) * (v < 0.65F ? 0.8F : 0.15F));
  }
  surface.colour = inside;
  const bool lit = UnitFloat(HashBits(window + 5)) <
                   (shop ? std::min(1.0F, 2.5F * lighting.lit_windows) : lighting.lit_windows);
  if (lit) {
    const Vec3 lamp = UnitFloat(HashBits(window + 6)) < 0.7F ? Vec3(0.62F, 0.40F, 0.19F)
                                                             : Vec3(0.50F, 0.48F, 0.44F);
    const float bright = (0.5F + 0.6F * UnitFloat(HashBits(window + 7))) * (0.6F + 0.5F * v);
    surface.glow = lamp * bright * (curtain > 0 ? 0.55F : 1.0F) * (0.65F + 8.0F * inside.x()) *
                   (lighting.condition == Condition::kDusk ? 0.9F : 0.55F);
  }
  surface.sheen = 0.09F;
  return surface;
}

Surface HouseWindow(const Material& material, const SurfacePoint& point, const Lighting& lighting,
                    bool shop) {
  Surface surface = HouseRoom(material, point, lighting, shop);
  const int columns = shop ? 2 : 1 + static_cast<int>(material.seed % 2);
  const int rows = shop ? 1 : 1 + static_cast<int>((material.seed >> 3U) % 3);
  const float wood = HouseWindowFrame(point.uv, columns, rows, shop ? 0.02F : 0.055F,
                                      0.5F * HouseFootprint(point) / 1.2F + 1e-4F);
  surface.colour = Blend(surface.colour, material.colour, wood);
  surface.glow *= 1 - wood;
  surface.sheen = Blend(surface.sheen, 0.015F, wood);
  surface.openness = 0.85F;
  return surface;
}

Vec3 HouseDoor(const Material& material, const SurfacePoint& point) {
  const float u = point.uv.x();
  const float v = point.uv.y();
  const float border = std::min(std::min(u, 1 - u), std::min(v, 1 - v));
  if (border < 0.06F || v > 0.84F) {
    return v > 0.86F && border > 0.04F ? Vec3(0.05F, 0.06F, 0.07F) : material.accent;
  }
  const float panel_u = std::abs(std::fmod(u * 2, 1.0F) - 0.5F);
  const float panel_v = std::abs(std::fmod(v * 2.4F, 1.0F) - 0.5F);
  const float edge = std::max(panel_u, panel_v);
  const float groove = FilteredBand(0.33F, 0.38F, edge, 3 * point.width_m);
  return material.colour * (1 - 0.45F * groove);
}

}  // namespace

Surface PaintHouse(const Material& material, const SurfacePoint& point, const Lighting& lighting) {
  const float footprint = HouseFootprint(point);
  Surface surface;
  switch (material.kind) {
    case MaterialKind::kWindow:
      surface = HouseWindow(material, point, lighting, false);
      break;
    case MaterialKind::kShopWindow:
      surface = HouseWindow(material, point, lighting, true);
      break;
    case MaterialKind::kDoor:
      surface.colour = HouseDoor(material, point);
      surface.openness = 0.7F;
      surface.sheen = 0.02F;
      break;
    case MaterialKind::kBrick:
      surface.colour =
          HouseBrick(material, point, footprint) * HouseStains(point, material.seed, footprint);
      break;
    case MaterialKind::kRoofTiles:
      surface.colour = HouseRoofTiles(material, point, footprint);
      break;
    default:
      surface.colour =
          HousePlaster(material, point, footprint) * HouseStains(point, material.seed, footprint);
  }
  surface.normal = point.normal;
  surface.instance = point.instance;
  surface.openness *= point.openness;
  if (std::abs(point.normal.z()) < 0.3F && material.kind != MaterialKind::kRoofTiles) {
    surface.openness *= 0.70F + 0.30F * SmoothStep(0.0F, 2.2F, point.uv.y());
  }
  return surface;
}

}  // namespace livemap::simulation
