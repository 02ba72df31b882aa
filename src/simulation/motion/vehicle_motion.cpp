#include "simulation/motion/vehicle_motion.h"

#include <algorithm>
#include <cmath>

#include "simulation/objects/counter_random.h"

namespace livemap::simulation {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;
/// Where the car's springs sway: cycles per second.
constexpr double kPitchHz = 1.35;
constexpr double kBounceHz = 1.7;
/// Radians per m/s^2 of braking.
constexpr double kDive = 0.0035;
/// A body that stands does not sway.
constexpr double kSwaySpeedMps = 2;

}  // namespace

VehicleMotion::Phases::Phases(std::uint64_t seed) {
  CounterRandom random(seed, 9);
  for (double& angle : angles) angle = random.Uniform(0.0, kTwoPi);
}

VehicleMotion::VehicleMotion(const Street& street, const DrivingStyle& style, double start_m)
    : street_(street),
      phases_(street.seed()),
      profile_(street, style, start_m, phases_.angles[0]) {}

Eigen::Isometry3d VehicleMotion::WorldFromBase(double time_s) const {
  const double* phase = phases_.angles;
  const double along = AlongM(time_s);
  const double omega = kTwoPi / 90;  // per metre of road
  const double wander = 0.12 * std::sin(omega * along + phase[1]);
  const double drift = 0.12 * omega * std::cos(omega * along + phase[1]);
  const double left = street_.lane_left_m() + wander;
  const double moving = std::min(1.0, SpeedMps(time_s) / kSwaySpeedMps);
  const double sway = moving * std::sin(kTwoPi * kBounceHz * time_s + phase[2]) *
                      (0.6 + 0.4 * std::sin(0.7 * time_s + phase[3]));
  const double nod = moving * std::sin(kTwoPi * kPitchHz * time_s + phase[4]) *
                     (0.6 + 0.4 * std::sin(0.5 * time_s + phase[5]));
  const double dive = -kDive * profile_.AccelerationMps2(time_s);
  const double slope = std::atan(street_.line().Slope(along));
  const double crown = static_cast<double>(kCrownFall);
  const Eigen::Vector3d place =
      street_.line().At(along, left, -crown * std::abs(left) + 0.006 * sway);
  return Eigen::Translation3d(place) *
         Eigen::AngleAxisd(street_.line().HeadingRad(along) + drift, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(-slope + 0.0025 * nod + dive, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(crown, Eigen::Vector3d::UnitX());
}

VehicleKinematics VehicleMotion::StateAt(double time_s) const {
  constexpr double kHalfS = 0.005;
  VehicleKinematics state;
  state.world_from_base = WorldFromBase(time_s);
  const Eigen::Isometry3d before = WorldFromBase(time_s - kHalfS);
  const Eigen::Isometry3d after = WorldFromBase(time_s + kHalfS);
  const Eigen::Matrix3d base_from_world = state.world_from_base.linear().transpose();
  state.velocity_mps =
      base_from_world * (after.translation() - before.translation()) / (2 * kHalfS);
  const Eigen::AngleAxisd turn(before.linear().transpose() * after.linear());
  state.turn_rate_radps = turn.axis() * turn.angle() / (2 * kHalfS);
  return state;
}

}  // namespace livemap::simulation
