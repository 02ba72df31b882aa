#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>

#include "simulation/room/room_plan.h"

namespace livemap::simulation {

/// How a camera moves through a room. All are smooth functions of time.
enum class RoomMotion {
  kHand,       ///< Sways by decimetres and turns by some degrees about one place.
  kWalking,    ///< Sets off and walks around the middle at 0.9 m/s, with the bob of steps.
  kFastTurn,   ///< Stands and looks to both sides by 60 degrees, at up to 90 deg/s.
  kShake,      ///< A hand that trembles: a centimetre and a degree, five times a second.
  kCar,        ///< Drives off and around a hall, up to 5 m/s.
  kFromSpeed,  ///< Goes 0.75 m/s and turns 18 deg/s from the first picture on, always alike.
};

/// "hand", "walking", "fast-turn", "shake", "car", "from-speed"; none for anything else.
std::optional<RoomMotion> ParseRoomMotion(const std::string& name);

/// Where the camera (optical frame) is in the room at a time, s; `vigour` scales all speeds. The
/// hand at 1 is calm, about 0.15 m/s and 8 deg/s.
Eigen::Isometry3d RoomCameraPose(const RoomPlan& plan, RoomMotion motion, double time_s,
                                 double vigour);

}  // namespace livemap::simulation
