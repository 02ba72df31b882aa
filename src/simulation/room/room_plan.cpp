#include "simulation/room/room_plan.h"

#include <algorithm>
#include <cmath>

#include "simulation/objects/counter_random.h"

namespace livemap::simulation {
namespace {

/// How far a hall is larger than a room.
constexpr float kHallOfRoom = 6;

RoomFinish FinishOf(MaterialKind kind, const Vec3& colour, std::uint32_t seed) {
  RoomFinish finish;
  finish.material.kind = kind;
  finish.material.colour = colour;
  finish.material.seed = seed;
  return finish;
}

/// Draws a room's parts, one after the other, from one stream of random numbers.
class RoomBuilder {
 public:
  RoomBuilder(RoomPlan& plan, std::uint64_t stream, float scale)
      : plan_(plan), random_(plan.seed, stream, 0), scale_(scale) {}

  float Real(double low, double high) { return static_cast<float>(random_.Uniform(low, high)); }
  bool Chance(double probability) { return random_.Chance(probability); }
  int Index(int count) { return random_.Index(count); }
  Vec3 Colour() {
    const float red = Real(0.05, 0.7), green = Real(0.05, 0.7);
    return {red, green, Real(0.05, 0.7)};
  }
  void Add(const Vec3& low, const Vec3& high, MaterialKind kind, const Vec3& colour) {
    plan_.boxes.push_back(
        {low, high, FinishOf(kind, colour, static_cast<std::uint32_t>(random_.Bits()))});
  }

  RoomFinish Face();
  void Hang(int axis, bool high);
  void PlaceAtWall(int axis, bool high);
  void PlaceShelf(int axis, bool high);

 private:
  struct Slot {
    float along, width, depth, bottom, top;
  };
  MaterialKind AnyKind();
  void AddAtWall(int axis, bool high, const Slot& slot, MaterialKind kind, const Vec3& colour);
  float HalfAlong(int axis) const { return plan_.half_size[1 - axis]; }

  RoomPlan& plan_;
  CounterRandom random_;
  float scale_;
};

MaterialKind RoomBuilder::AnyKind() {
  constexpr std::array<MaterialKind, 5> kKinds = {MaterialKind::kBrick, MaterialKind::kStripes,
                                                  MaterialKind::kPlain, MaterialKind::kPlain,
                                                  MaterialKind::kWood};
  return kKinds[static_cast<std::size_t>(Index(static_cast<int>(kKinds.size())))];
}

/// Half of the faces repeat themselves without any other mark.
RoomFinish RoomBuilder::Face() {
  const auto seed = static_cast<std::uint32_t>(random_.Bits());
  const Vec3 colour = Vec3::Constant(Real(0.25, 0.65)) + 0.3F * Colour();
  if (Chance(0.5)) {
    return FinishOf(Chance(0.5) ? MaterialKind::kBrick : MaterialKind::kPlaster, colour, seed);
  }
  constexpr std::array<RoomPattern, 5> kPatterns = {RoomPattern::kTiles, RoomPattern::kChecks,
                                                    RoomPattern::kFence, RoomPattern::kWindows,
                                                    RoomPattern::kBands};
  RoomFinish finish =
      FinishOf(Chance(0.5) ? MaterialKind::kPlain : MaterialKind::kPlaster, colour, seed);
  finish.pattern = kPatterns[static_cast<std::size_t>(Index(static_cast<int>(kPatterns.size())))];
  finish.period_m = scale_ * Real(0.12, 0.6);
  return finish;
}

void RoomBuilder::AddAtWall(int axis, bool high, const Slot& slot, MaterialKind kind,
                            const Vec3& colour) {
  const float wall = plan_.half_size[axis];
  Vec3 from(0, 0, slot.bottom), to(0, 0, slot.top);
  from[axis] = high ? wall - slot.depth : -wall;
  to[axis] = high ? wall : -wall + slot.depth;
  from[1 - axis] = slot.along;
  to[1 - axis] = slot.along + slot.width;
  Add(from, to, kind, colour);
}

/// A picture, flat on the wall.
void RoomBuilder::Hang(int axis, bool high) {
  const float width = scale_ * Real(0.2, 0.8), room = HalfAlong(axis) - width;
  const float bottom = scale_ * Real(0.9, 1.7);
  const Slot slot = {Real(-room, room), width, scale_ * 0.04F, bottom,
                     bottom + scale_ * Real(0.15, 0.6)};
  const MaterialKind kind = AnyKind();
  AddAtWall(axis, high, slot, kind, Colour());
}

/// A box or cupboard that stands at the wall.
void RoomBuilder::PlaceAtWall(int axis, bool high) {
  const float width = scale_ * Real(0.15, 0.7), room = HalfAlong(axis) - width;
  const float depth = std::min(scale_ * Real(0.15, 0.5), 0.3F * plan_.half_size[axis]);
  const Slot slot = {Real(-room, room), width, depth, 0,
                     scale_ * (Chance(0.2) ? Real(1.2, 1.9) : Real(0.1, 0.7))};
  const MaterialKind kind = AnyKind();
  AddAtWall(axis, high, slot, kind, Colour());
}

void RoomBuilder::PlaceShelf(int axis, bool high) {
  const float length = scale_ * Real(0.8, 1.8);
  const float room = std::max(0.0F, HalfAlong(axis) - length);
  const float begin = Real(-room, room);
  for (int board = 0; board < 4; ++board) {
    const float z = scale_ * (0.3F + 0.35F * static_cast<float>(board));
    AddAtWall(axis, high, {begin, length, scale_ * 0.35F, z - scale_ * 0.02F, z},
              MaterialKind::kWood, Vec3(0.3F, 0.2F, 0.12F));
    for (float at = 0; at + scale_ * 0.08F < length;) {
      const float width = scale_ * Real(0.02, 0.08), depth = scale_ * Real(0.15, 0.3);
      AddAtWall(axis, high, {begin + at, width, depth, z, z + scale_ * Real(0.16, 0.28)},
                MaterialKind::kPlain, Colour());
      at += width + (Chance(0.15) ? scale_ * 0.12F : scale_ * 0.004F);
    }
  }
}

void FurnishStandardRoom(RoomPlan& plan) {
  CounterRandom random(plan.seed, 31, 0);
  const auto real = [&random](double low, double high) {
    return static_cast<float>(random.Uniform(low, high));
  };
  const auto colour = [&real] { return Vec3(real(0.05, 0.7), real(0.05, 0.7), real(0.05, 0.7)); };
  const auto add = [&plan, &random](const Vec3& low, const Vec3& high, MaterialKind kind,
                                    const Vec3& paint) {
    plan.boxes.push_back(
        {low, high, FinishOf(kind, paint, static_cast<std::uint32_t>(random.Bits()))});
  };
  // Pictures on the wall that the camera looks at, and on the side walls.
  for (int i = 0; i < 7; ++i) {
    const float y = -1.7F + 0.5F * static_cast<float>(i), z = real(1.2, 1.9);
    add(Vec3(2.44F, y, z), Vec3(2.5F, y + real(0.2, 0.4), z + real(0.2, 0.5)),
        i % 2 == 0 ? MaterialKind::kBrick : MaterialKind::kStripes, colour());
  }
  // A shelf with books.
  for (int board = 0; board < 4; ++board) {
    const float z = 0.3F + 0.32F * static_cast<float>(board);
    add(Vec3(2.05F, -1.9F, z - 0.02F), Vec3(2.4F, 0.2F, z), MaterialKind::kWood,
        Vec3(0.3F, 0.2F, 0.12F));
    for (float y = -1.85F; y < 0.1F;) {
      const float width = real(0.02, 0.07);
      add(Vec3(2.1F, y, z), Vec3(2.1F + real(0.12, 0.25), y + width, z + real(0.16, 0.27)),
          MaterialKind::kPlain, colour());
      y += width + (random.Chance(0.15) ? 0.1F : 0.003F);
    }
  }
  // A table with things on it, and boxes on the floor.
  add(Vec3(0.9F, 0.4F, 0.70F), Vec3(1.7F, 1.7F, 0.74F), MaterialKind::kWood,
      Vec3(0.5F, 0.36F, 0.2F));
  for (const float x : {0.95F, 1.6F}) {
    for (const float y : {0.45F, 1.6F}) {
      add(Vec3(x, y, 0), Vec3(x + 0.05F, y + 0.05F, 0.7F), MaterialKind::kWood,
          Vec3(0.4F, 0.28F, 0.16F));
    }
  }
  for (int i = 0; i < 14; ++i) {
    const float x = real(0.95, 1.55), y = real(0.45, 1.55);
    add(Vec3(x, y, 0.74F),
        Vec3(x + real(0.04, 0.15), y + real(0.04, 0.15), 0.74F + real(0.03, 0.3)),
        i % 3 == 0 ? MaterialKind::kStripes : MaterialKind::kPlain, colour());
  }
  for (int i = 0; i < 8; ++i) {
    const float x = real(0.2, 1.9), y = real(-1.6, 1.2);
    add(Vec3(x, y, 0), Vec3(x + real(0.15, 0.4), y + real(0.15, 0.4), real(0.1, 0.45)),
        i % 2 == 0 ? MaterialKind::kBrick : MaterialKind::kWood, colour());
  }
}

/// The middle of the floor is to walk on; what is high stands at the walls.
void FurnishVariedRoom(RoomPlan& plan, float scale) {
  RoomBuilder room(plan, 34, scale);
  for (auto& axis : plan.faces) {
    for (RoomFinish& face : axis) face = room.Face();
  }
  const double clutter = room.Real(0.3, 1.5);
  for (const int axis : {0, 1}) {
    for (const bool high : {false, true}) {
      const auto count = [&](double most) { return static_cast<int>(room.Real(0.3, 1) * most); };
      for (int i = count(6 * clutter); i > 0; --i) room.Hang(axis, high);
      for (int i = count(7 * clutter); i > 0; --i) room.PlaceAtWall(axis, high);
      if (room.Chance(0.4)) room.PlaceShelf(axis, high);
    }
  }
}

}  // namespace

RoomPlan StandardRoomPlan(std::uint64_t seed) {
  RoomPlan plan;
  plan.seed = seed;
  const auto faces = static_cast<std::uint32_t>(seed);
  plan.faces[2][0] = FinishOf(MaterialKind::kWood, Vec3(0.36F, 0.22F, 0.12F), faces);
  plan.faces[2][0].pattern = RoomPattern::kBoards;
  plan.faces[2][1] = FinishOf(MaterialKind::kPlaster, Vec3(0.75F, 0.74F, 0.70F), faces + 1);
  plan.faces[0].fill(FinishOf(MaterialKind::kBrick, Vec3(0.45F, 0.22F, 0.15F), faces + 2));
  plan.faces[1].fill(FinishOf(MaterialKind::kPlaster, Vec3(0.55F, 0.58F, 0.50F), faces + 3));
  FurnishStandardRoom(plan);
  return plan;
}

RoomPlan VariedRoomPlan(std::uint64_t seed, RoomScale scale) {
  const float size = scale == RoomScale::kHall ? kHallOfRoom : 1;
  RoomPlan plan;
  plan.seed = seed;
  CounterRandom random(seed, 35, 0);
  plan.half_size.x() = size * random.Uniform(1.6F, 4.0F);
  plan.half_size.y() = size * random.Uniform(1.6F, 3.5F);
  plan.half_size.z() = std::sqrt(size) * random.Uniform(1.15F, 1.6F);
  plan.lamp = Vec3(size * random.Uniform(-0.6F, 0.6F), size * random.Uniform(-0.6F, 0.6F),
                   1.85F * plan.half_size.z());
  const float area = plan.half_size.head<2>().prod() / (2.5F * 2.0F);
  plan.lamp_power = std::max(1.0F, 0.8F * area);
  plan.walk_x_m = 0.38F * plan.half_size.x();
  plan.walk_y_m = 0.38F * plan.half_size.y();
  plan.heading_rad = random.Uniform(-3.1F, 3.1F);
  // From beside the middle over the middle.
  plan.stand = Vec3(-plan.walk_x_m * std::cos(plan.heading_rad),
                    -plan.walk_y_m * std::sin(plan.heading_rad), 1.35F)
                   .cast<double>();
  FurnishVariedRoom(plan, size);
  return plan;
}

float PaintRoomPattern(const RoomFinish& finish, const Vec2& uv, float footprint) {
  const float period = finish.period_m;
  const auto stripes = [&](float share, float at) {
    return FilteredStripes(share * period, period, at, footprint);
  };
  switch (finish.pattern) {
    case RoomPattern::kNone:
      return 1;
    case RoomPattern::kBoards: {
      const float seams = std::max(FilteredStripes(0.006F, 0.12F, uv.x(), footprint),
                                   FilteredStripes(0.006F, 1.3F, uv.y(), footprint));
      return 1 - 0.6F * seams;
    }
    case RoomPattern::kTiles:
      return 1 - 0.65F * std::max(stripes(0.06F, uv.x()), stripes(0.06F, uv.y()));
    case RoomPattern::kChecks: {
      const float across = stripes(0.5F, uv.x()), up = stripes(0.5F, uv.y());
      return 1 - 0.6F * (across + up - 2 * across * up);
    }
    case RoomPattern::kFence:
      return 1 - 0.7F * stripes(0.35F, uv.x());
    case RoomPattern::kWindows:
      return 1 - 0.75F * stripes(0.6F, uv.x()) * stripes(0.7F, uv.y());
    case RoomPattern::kBands:
      return 1 - 0.55F * stripes(0.5F, uv.y());
  }
  return 1;
}

}  // namespace livemap::simulation
