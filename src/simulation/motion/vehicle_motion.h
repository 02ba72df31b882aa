#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "simulation/motion/speed_profile.h"
#include "simulation/world/street.h"

namespace livemap::simulation {

/// What a vehicle does at a moment.
struct VehicleKinematics {
  Eigen::Isometry3d world_from_base = Eigen::Isometry3d::Identity();
  Eigen::Vector3d velocity_mps = Eigen::Vector3d::Zero();     ///< Of base_link, in base_link.
  Eigen::Vector3d turn_rate_radps = Eigen::Vector3d::Zero();  ///< In base_link.
};

/// How a vehicle drives down its lane: SpeedProfile's speed, a little wander across the lane
/// (0.12 m within 90 m), a body on springs. The springs let the body bounce by up to 6 mm at
/// 1.7 Hz and pitch by up to 0.0025 rad at 1.35 Hz, both fading out below 2 m/s, and nod by
/// 0.0035 rad per m/s^2 of braking (2 degrees per g, front down). A pure function of time.
class VehicleMotion {
 public:
  /// `street` must outlive the motion; `start_m` is the place on its road at time 0.
  VehicleMotion(const Street& street, const DrivingStyle& style, double start_m);

  /// Distance along the road's middle line since the world's start, metres.
  double AlongM(double time_s) const { return profile_.AlongM(time_s); }
  double SpeedMps(double time_s) const { return profile_.SpeedMps(time_s); }
  /// Pose of base_link (x forward, y left, z up, on the road) in the world frame.
  Eigen::Isometry3d WorldFromBase(double time_s) const;
  /// Pose and how it changes, by differences over 10 ms.
  VehicleKinematics StateAt(double time_s) const;

 private:
  struct Phases {
    explicit Phases(std::uint64_t seed);
    double angles[6];
  };

  const Street& street_;
  const Phases phases_;
  const SpeedProfile profile_;
};

}  // namespace livemap::simulation
