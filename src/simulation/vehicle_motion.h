#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "simulation/street.h"

namespace livemap {

/// How a vehicle drives down its lane: speed that breathes, a little wander, a body that pitches
/// and bounces on its springs. A pure function of time.
class VehicleMotion {
 public:
  /// `street` must outlive the motion. `speed_mps` is the mean.
  VehicleMotion(const Street& street, double speed_mps, double start_m);

  /// Distance along the road's middle line since the world's start, metres.
  double AlongM(double time_s) const;
  /// Pose of base_link (x forward, y left, z up, on the road) in the world frame.
  Eigen::Isometry3d WorldFromBase(double time_s) const;

 private:
  const Street& street_;
  double speed_mps_;
  double start_m_;
  double phases_[6];
};

}  // namespace livemap
