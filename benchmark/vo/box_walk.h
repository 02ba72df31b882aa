#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "box_room.h"

namespace livemap::bench {

/// How a camera moves through a BoxRoom: to and fro on a smooth way about its middle while it turns
/// to and fro, already at speed in the first frame. At a speed of 1 it moves by up to 2.5 cm and
/// 0.6 degrees in 1/30 s.
class BoxWalk {
 public:
  /// Drawn from the seed, until it stays clear of everything; throws Error where none does.
  BoxWalk(const BoxRoom& room, std::uint64_t seed, double speed);

  /// Where the camera (optical frame) is in the room at a time, s.
  Eigen::Isometry3d At(double time_s) const;

 private:
  struct Sway {
    double amplitude = 0, rate = 0, phase = 0;
    double At(double time_s) const;
  };
  Eigen::Vector3d Place(double time_s) const;

  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
  double heading_rad_ = 0;
  Sway along_, across_, up_, yaw_, pitch_, roll_;
};

}  // namespace livemap::bench
