#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "simulation/objects/mesh.h"

namespace livemap::simulation {

/// What is drawn over a face's material, the same again and again: where odometry takes one tile
/// for its neighbour.
enum class RoomPattern : std::uint8_t {
  kNone,
  kBoards,   ///< Seams of floor boards.
  kTiles,    ///< Dark seams around squares.
  kChecks,   ///< Squares of two shades in turn.
  kFence,    ///< Upright bars.
  kWindows,  ///< Dark panes in rows and columns.
  kBands,    ///< Level stripes.
};

struct RoomFinish {
  Material material;
  RoomPattern pattern = RoomPattern::kNone;
  float period_m = 0.3F;  ///< Of the pattern; kBoards has its own.
};

/// A thing with six faces along the axes, m.
struct RoomBox {
  Vec3 low, high;
  RoomFinish finish;
};

/// What a room is built of. World frame: z up, origin in the middle of the floor, metres.
struct RoomPlan {
  std::uint64_t seed = 1;
  Vec3 half_size = Vec3(2.5F, 2.0F, 1.3F);
  Vec3 lamp = Vec3(0.4F, -0.3F, 2.4F);
  float lamp_power = 1;  ///< A larger room needs a brighter one.
  /// The room's own faces, by axis x, y, z of the wall's place: at its low side, at its high side.
  std::array<std::array<RoomFinish, 2>, 3> faces;
  std::vector<RoomBox> boxes;
  /// Where a camera is held, and which way it looks about the vertical axis, rad.
  Eigen::Vector3d stand = Eigen::Vector3d(-1.2, 0, 1.35);
  float heading_rad = 0;
  /// Half axes of the ellipse around the middle that is free to walk on, m.
  float walk_x_m = 1, walk_y_m = 0.8F;
};

/// The room of 5 x 4 x 2.6 m whose furniture alone is drawn from the seed.
RoomPlan StandardRoomPlan(std::uint64_t seed);

enum class RoomScale {
  kRoom,  ///< 3 to 8 m long.
  kHall,  ///< Six times that: for a car.
};

/// A room whose size, faces, clutter and place of the camera are drawn from the seed as well; about
/// half of its faces repeat a pattern.
RoomPlan VariedRoomPlan(std::uint64_t seed, RoomScale scale);

/// Share of the material's light that a pattern leaves at `uv` (m along the face), averaged over a
/// pixel that covers `footprint` m.
float PaintRoomPattern(const RoomFinish& finish, const Vec2& uv, float footprint);

}  // namespace livemap::simulation
