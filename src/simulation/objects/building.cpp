#include "simulation/objects/building.h"

#include <array>
#include <cmath>

namespace livemap::simulation {
namespace {

const std::array<Vec3, 6> kBricks = {Vec3(0.36F, 0.12F, 0.075F), Vec3(0.30F, 0.10F, 0.07F),
                                     Vec3(0.42F, 0.19F, 0.11F),  Vec3(0.45F, 0.32F, 0.19F),
                                     Vec3(0.26F, 0.13F, 0.10F),  Vec3(0.38F, 0.16F, 0.12F)};
const std::array<Vec3, 8> kPlasters = {Vec3(0.66F, 0.60F, 0.48F), Vec3(0.70F, 0.66F, 0.60F),
                                       Vec3(0.58F, 0.44F, 0.26F), Vec3(0.52F, 0.54F, 0.50F),
                                       Vec3(0.62F, 0.42F, 0.32F), Vec3(0.44F, 0.50F, 0.55F),
                                       Vec3(0.68F, 0.56F, 0.36F), Vec3(0.74F, 0.72F, 0.68F)};
const std::array<Vec3, 5> kFrames = {Vec3(0.75F, 0.74F, 0.72F), Vec3(0.70F, 0.70F, 0.68F),
                                     Vec3(0.12F, 0.08F, 0.05F), Vec3(0.06F, 0.10F, 0.07F),
                                     Vec3(0.10F, 0.10F, 0.11F)};
const std::array<Vec3, 5> kDoors = {Vec3(0.16F, 0.03F, 0.03F), Vec3(0.03F, 0.08F, 0.05F),
                                    Vec3(0.04F, 0.06F, 0.14F), Vec3(0.16F, 0.09F, 0.04F),
                                    Vec3(0.05F, 0.05F, 0.05F)};

struct Style {
  float floor_m = 3.0F;
  int floors = 2;
  float window_width_m = 1.1F;
  float window_height_m = 1.5F;
  float sill_m = 0.9F;
  float recess_m = 0.14F;
  bool shop = false;
  bool gable = true;
  std::uint16_t wall = 0;
  std::uint16_t trim = 0;
  std::uint16_t pane = 0;
  std::uint16_t shop_pane = 0;
  std::uint16_t door = 0;
};

/// The front in the plane y = 0 with openings that lie back in it.
class BuildingFront {
 public:
  BuildingFront(const Style& style, float width, MeshBuilder& builder)
      : style_(style), width_(width), builder_(builder) {}

  void Wall(float x0, float z0, float x1, float z1) {
    if (x1 - x0 < 0.005F || z1 - z0 < 0.005F) return;
    builder_.UseMaterial(style_.wall);
    builder_.AddQuad({x0, 0, z0}, {x1, 0, z0}, {x1, 0, z1}, {x0, 0, z1}, {x0, z0}, {x1, z1});
  }

  void Opening(float x0, float z0, float x1, float z1, std::uint16_t pane, bool sill) {
    const float y = style_.recess_m;
    builder_.UseMaterial(pane);
    builder_.AddQuad({x0, y, z0}, {x1, y, z0}, {x1, y, z1}, {x0, y, z1}, {0, 0}, {1, 1});
    builder_.UseMaterial(style_.wall);
    builder_.SetOpenness(0.75F);
    builder_.AddQuad({x0, 0, z0}, {x0, y, z0}, {x0, y, z1}, {x0, 0, z1}, {x0, z0}, {x0 + y, z1});
    builder_.AddQuad({x1, y, z0}, {x1, 0, z0}, {x1, 0, z1}, {x1, y, z1}, {x1, z0}, {x1 + y, z1});
    builder_.AddQuad({x0, y, z1}, {x1, y, z1}, {x1, 0, z1}, {x0, 0, z1}, {x0, z1}, {x1, z1 + y});
    builder_.AddQuad({x0, 0, z0}, {x1, 0, z0}, {x1, y, z0}, {x0, y, z0}, {x0, z0}, {x1, z0 + y});
    builder_.SetOpenness(1);
    if (!sill) return;
    builder_.UseMaterial(style_.trim);
    builder_.AddBox({x0 - 0.07F, -0.07F, z0 - 0.09F}, {x1 + 0.07F, y, z0});
    builder_.AddBox({x0 - 0.05F, -0.025F, z1}, {x1 + 0.05F, 0, z1 + 0.16F});
  }

  /// One floor of equal windows; a door instead of the window of column `door` (-1: none).
  void Floor(float base, float height, int columns, int door) {
    const float cell = width_ / static_cast<float>(columns);
    const float low = base + style_.sill_m;
    const float high = low + style_.window_height_m;
    Wall(0, high, width_, base + height);
    for (int column = 0; column < columns; ++column) {
      const float left = cell * static_cast<float>(column);
      const float middle = left + 0.5F * cell;
      const bool is_door = column == door;
      const float half = is_door ? 0.5F : 0.5F * style_.window_width_m;
      const float bottom = is_door ? base + 0.12F : low;
      Wall(left, bottom, middle - half, high);
      Wall(middle + half, bottom, left + cell, high);
      Wall(left, base, left + cell, bottom);
      Opening(middle - half, bottom, middle + half, high, is_door ? style_.door : style_.pane,
              !is_door);
    }
  }

  void Shop(float height, int columns) {
    const float cell = width_ / static_cast<float>(columns);
    const float low = 0.45F;
    const float high = height - 0.75F;
    Wall(0, high, width_, height);
    for (int column = 0; column < columns; ++column) {
      const float left = cell * static_cast<float>(column);
      const bool is_door = column == columns / 2;
      const float margin = is_door ? 0.5F * cell - 0.55F : 0.18F;
      const float bottom = is_door ? 0.05F : low;
      Wall(left, bottom, left + margin, high);
      Wall(left + cell - margin, bottom, left + cell, high);
      Wall(left, 0, left + cell, bottom);
      Opening(left + margin, bottom, left + cell - margin, high,
              is_door ? style_.door : style_.shop_pane, false);
    }
    builder_.UseMaterial(style_.trim);
    builder_.AddBox({0.1F, -0.12F, high + 0.1F}, {width_ - 0.1F, 0, height - 0.1F});
  }

 private:
  const Style& style_;
  float width_;
  MeshBuilder& builder_;
};

Style DrawBuildingStyle(float width, CounterRandom& random, MeshBuilder& builder) {
  Style style;
  const bool brick = random.Chance(0.5);
  Material wall;
  wall.seed = random.Bits32();
  wall.kind = brick ? MaterialKind::kBrick : MaterialKind::kPlaster;
  wall.colour = brick ? kBricks[static_cast<std::size_t>(random.Index(6))]
                      : kPlasters[static_cast<std::size_t>(random.Index(8))];
  wall.colour *= random.Uniform(0.85F, 1.12F);
  style.wall = builder.SetMaterial(wall);
  const Vec3& frame = kFrames[static_cast<std::size_t>(random.Index(5))];
  style.trim = builder.SetMaterial({MaterialKind::kConcrete,
                                    Vec3(0.52F, 0.50F, 0.46F) * random.Uniform(0.7F, 1.15F),
                                    Vec3::Ones(), wall.seed + 1});
  style.pane = builder.SetMaterial({MaterialKind::kWindow, frame, frame, random.Bits32()});
  const Vec3 sign(random.Uniform(0.05F, 0.5F), random.Uniform(0.05F, 0.4F),
                  random.Uniform(0.05F, 0.4F));
  style.shop_pane = builder.SetMaterial({MaterialKind::kShopWindow, frame, sign, random.Bits32()});
  style.door =
      builder.SetMaterial({MaterialKind::kDoor, kDoors[static_cast<std::size_t>(random.Index(5))],
                           frame, random.Bits32()});
  style.floors = 2 + random.Index(width > 9 ? 4 : 3);
  style.floor_m = random.Uniform(2.8F, 3.3F);
  style.window_width_m = random.Uniform(0.9F, 1.35F);
  style.window_height_m = random.Uniform(1.35F, 1.75F);
  style.sill_m = random.Uniform(0.75F, 0.95F);
  style.recess_m = random.Uniform(0.1F, 0.2F);
  style.shop = style.floors > 2 && random.Chance(0.5);
  style.gable = style.floors < 4 && random.Chance(0.75);
  return style;
}

void AddBuildingRoof(const Style& style, float width, float depth, float height,
                     CounterRandom& random, MeshBuilder& builder) {
  if (!style.gable) {
    builder.UseMaterial(style.trim);
    builder.AddBox({-0.05F, -0.28F, height - 0.1F}, {width + 0.05F, 0.1F, height + 0.12F});
    builder.AddBox({-0.02F, -0.14F, height - 0.3F}, {width + 0.02F, 0.05F, height - 0.1F});
    builder.UseMaterial(style.wall);
    builder.AddBox({0, 0, height + 0.12F}, {width, 0.25F, height + 0.65F});
    builder.AddQuad({0, 0, height}, {width, 0, height}, {width, depth, height}, {0, depth, height},
                    {0, 0}, {width, depth});
    return;
  }
  const float ridge = height + 0.5F * depth * random.Uniform(0.6F, 0.95F);
  const float slope = std::hypot(0.5F * depth, ridge - height);
  const float over = 0.35F;
  const float drop = over * (ridge - height) / (0.5F * depth);
  builder.SetMaterial({MaterialKind::kRoofTiles,
                       random.Chance(0.6) ? Vec3(0.30F, 0.11F, 0.07F) : Vec3(0.09F, 0.09F, 0.10F),
                       Vec3::Ones(), random.Bits32()});
  builder.AddQuad({0, -over, height - drop}, {width, -over, height - drop},
                  {width, 0.5F * depth, ridge}, {0, 0.5F * depth, ridge}, {0, 0}, {width, slope});
  builder.AddQuad({width, depth, height}, {0, depth, height}, {0, 0.5F * depth, ridge},
                  {width, 0.5F * depth, ridge}, {0, 0}, {width, slope});
  builder.UseMaterial(style.wall);
  for (const float x : {0.0F, width}) {
    const Vec3 normal(x > 0 ? 1.0F : -1.0F, 0, 0);
    const std::uint32_t first = builder.AddVertex({x, 0, height}, normal, {0, height});
    builder.AddVertex({x, depth, height}, normal, {depth, height});
    builder.AddVertex({x, 0.5F * depth, ridge}, normal, {0.5F * depth, ridge});
    builder.AddTriangle(first, first + 1, first + 2);
  }
  const float x = random.Uniform(0.15F, 0.8F) * width;
  builder.AddBox({x, 0.5F * depth - 0.3F, ridge - 0.8F},
                 {x + 0.7F, 0.5F * depth + 0.3F, ridge + 0.9F});
  builder.SetMaterial({MaterialKind::kMetal, Vec3(0.25F, 0.25F, 0.25F), Vec3::Ones(), 0});
  builder.AddBox({0, -over - 0.06F, height - drop - 0.05F},
                 {width, -over + 0.06F, height - drop + 0.06F});
  builder.AddTube({0.12F, -0.08F, 0.1F}, {0.12F, -0.08F, height - 0.1F}, 0.05F, 0.05F, 6);
}

/// The walls to the neighbours; they are seen where houses end at a crossing or a gap.
void AddBuildingSides(const Style& style, float width, float depth, float ground_floor,
                      MeshBuilder& builder) {
  const Eigen::Affine3f frame = builder.frame();
  constexpr float kQuarterTurn = 1.57079633F;
  for (const bool right : {false, true}) {
    const Vec3 corner = right ? Vec3(width, 0, 0) : Vec3(0, depth, 0);
    builder.SetFrame(frame * Eigen::Translation3f(corner) *
                     Eigen::AngleAxisf(right ? kQuarterTurn : -kQuarterTurn, Vec3::UnitZ()));
    BuildingFront wall(style, depth, builder);
    wall.Wall(0, 0, depth, ground_floor);
    float base = ground_floor;
    for (int floor = 1; floor < style.floors; ++floor) {
      wall.Floor(base, style.floor_m, 2, -1);
      base += style.floor_m;
    }
  }
  builder.SetFrame(frame);
}

}  // namespace

void AddBuilding(float width_m, float depth_m, CounterRandom& random, MeshBuilder& builder) {
  const Style style = DrawBuildingStyle(width_m, random, builder);
  BuildingFront front(style, width_m, builder);
  const int columns = std::max(2, static_cast<int>(width_m / random.Uniform(2.0F, 2.9F)));
  float base = 0.0F;
  const float ground_floor = style.shop ? 3.7F : style.floor_m + 0.2F;
  if (style.shop) {
    front.Shop(ground_floor, std::max(2, static_cast<int>(width_m / 3.2F)));
  } else {
    front.Floor(base, ground_floor, columns, random.Index(columns));
  }
  base += ground_floor;
  const bool band = random.Chance(0.5);
  for (int floor = 1; floor < style.floors; ++floor) {
    if (band) {
      builder.UseMaterial(style.trim);
      builder.AddBox({0, -0.06F, base - 0.1F}, {width_m, 0, base + 0.1F});
    }
    front.Floor(base, style.floor_m, columns, -1);
    base += style.floor_m;
  }
  const float w = width_m;
  const float d = depth_m;
  AddBuildingSides(style, w, d, ground_floor, builder);
  builder.UseMaterial(style.wall);
  builder.AddQuad({w, d, 0}, {0, d, 0}, {0, d, base}, {w, d, base}, {0, 0}, {w, base});
  builder.UseMaterial(style.trim);
  if (!style.shop) builder.AddBox({0, -0.05F, 0}, {w, 0, 0.12F});
  AddBuildingRoof(style, w, d, base, random, builder);
}

}  // namespace livemap::simulation
