#include "simulation/room/room_motion.h"

#include <cmath>

#include "simulation/objects/counter_random.h"

namespace livemap::simulation {
namespace {

/// Above the floor; axes of yaw, pitch, roll in this order, forward along x.
struct CameraStance {
  Eigen::Vector3d place;
  double yaw = 0, pitch = 0, roll = 0;
};

CameraStance HandAt(const RoomPlan& plan, double t, double phase) {
  CameraStance at;
  at.place = Eigen::Vector3d(plan.stand.x() + 0.12 * std::sin(0.9 * t + phase),
                             plan.stand.y() + 0.15 * std::sin(1.1 * t + 2 * phase),
                             1.35 + 0.07 * std::sin(1.3 * t + 3 * phase));
  at.yaw = 0.09 * std::sin(0.8 * t + phase);
  at.pitch = 0.15 + 0.06 * std::sin(1.2 * t);
  at.roll = 0.04 * std::sin(1.5 * t + phase);
  return at;
}

/// `way_m` along the ellipse around the middle, looking ahead.
CameraStance OnTheWayAround(const RoomPlan& plan, double way_m, double phase) {
  const double a = static_cast<double>(plan.walk_x_m), b = static_cast<double>(plan.walk_y_m);
  const double angle = phase + way_m / std::sqrt(0.5 * (a * a + b * b));
  CameraStance at;
  at.place = Eigen::Vector3d(a * std::cos(angle), b * std::sin(angle), 1.4);
  at.yaw = std::atan2(b * std::cos(angle), -a * std::sin(angle));
  at.pitch = 0.1;
  return at;
}

/// Way after `t` of a start from rest that reaches `speed` within `start_s`.
double WayFromRest(double t, double speed, double start_s) {
  return t < start_s ? 0.5 * speed * t * t / start_s : speed * (t - 0.5 * start_s);
}

CameraStance StanceAt(const RoomPlan& plan, RoomMotion motion, double t, double phase) {
  const double heading = static_cast<double>(plan.heading_rad);
  CameraStance at = HandAt(plan, t, phase);
  at.yaw += heading;
  switch (motion) {
    case RoomMotion::kHand:
      return at;
    case RoomMotion::kFastTurn:
      at.yaw += M_PI / 3 * std::sin(1.5 * t);
      return at;
    case RoomMotion::kShake:
      at.place += 0.01 * Eigen::Vector3d(std::sin(31 * t), std::sin(27 * t + 1), std::sin(35 * t));
      at.yaw += 0.02 * std::sin(29 * t + 2);
      at.pitch += 0.02 * std::sin(33 * t + phase);
      return at;
    case RoomMotion::kWalking:
      at = OnTheWayAround(plan, WayFromRest(t, 0.9, 0.7), phase);
      at.place.z() += 0.025 * std::sin(4 * M_PI * t);
      at.yaw += 0.03 * std::sin(2 * M_PI * t);
      at.pitch += 0.015 * std::sin(4 * M_PI * t + 1);
      at.roll = 0.015 * std::sin(2 * M_PI * t);
      return at;
    case RoomMotion::kCar:
      return OnTheWayAround(plan, WayFromRest(t, 5, 2), phase);
    case RoomMotion::kFromSpeed:
      at = OnTheWayAround(plan, 0.75 * t, phase);
      // Neither ahead nor to the middle, and never twice as fast.
      at.yaw = heading + 18 * M_PI / 180 * t;
      return at;
  }
  return at;
}

}  // namespace

std::optional<RoomMotion> ParseRoomMotion(const std::string& name) {
  if (name == "hand") return RoomMotion::kHand;
  if (name == "walking") return RoomMotion::kWalking;
  if (name == "fast-turn") return RoomMotion::kFastTurn;
  if (name == "shake") return RoomMotion::kShake;
  if (name == "car") return RoomMotion::kCar;
  if (name == "from-speed") return RoomMotion::kFromSpeed;
  return std::nullopt;
}

Eigen::Isometry3d RoomCameraPose(const RoomPlan& plan, RoomMotion motion, double time_s,
                                 double vigour) {
  const double phase = CounterRandom(plan.seed, 32, 0).Uniform(0.0, 2 * M_PI);
  const CameraStance at = StanceAt(plan, motion, time_s * vigour, phase);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = at.place;
  pose.linear() = (Eigen::AngleAxisd(at.yaw, Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(at.pitch, Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(at.roll, Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  // REP 103: the optical frame's x is right, y down, z forward.
  Eigen::Matrix3d optical;
  optical << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  pose.linear() = pose.linear() * optical;
  return pose;
}

}  // namespace livemap::simulation
