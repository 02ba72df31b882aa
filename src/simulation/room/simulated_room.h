#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "simulation/render/street_renderer.h"
#include "simulation/room/room_plan.h"

namespace livemap::simulation {

/// A furnished room and a camera in it: the test bed of visual odometry at indoor scale, with exact
/// truth. World frame: z up, origin in the middle of the floor, metres. The same plan gives the
/// same bytes.
class SimulatedRoom {
 public:
  explicit SimulatedRoom(RoomPlan plan);
  /// The standard room.
  explicit SimulatedRoom(std::uint64_t seed) : SimulatedRoom(StandardRoomPlan(seed)) {}

  const RoomPlan& plan() const { return plan_; }

  /// Takes a picture; every pixel is the mean of `rays` x `rays` rays. `gain` is the exposure: grey
  /// values in linear light are multiplied by it. Where `last_row` is given, the shutter rolls: the
  /// camera is there when it reads the picture's last row, and the truth is that of the first.
  SimulatedFrame Render(const SimulatedCamera& camera, const Eigen::Isometry3d& world_from_optical,
                        std::uint32_t frame_number, float gain, int rays, int threads,
                        const std::optional<Eigen::Isometry3d>& last_row = std::nullopt) const;

 private:
  struct Hit {
    float distance = 0;            ///< In lengths of the ray's direction.
    const RoomBox* box = nullptr;  ///< None: the room's own face.
    int axis = 0;                  ///< Of the face's normal.
    float sign = 1;                ///< The normal's, towards the viewer.
  };

  Hit Cast(const Vec3& from, const Vec3& direction) const;
  Vec3 Shade(const Vec3& from, const Vec3& direction, const Hit& hit, float pixel_angle) const;

  RoomPlan plan_;
  Lighting lighting_;
  Vec3 low_, high_;  // The room's corners.
};

}  // namespace livemap::simulation
