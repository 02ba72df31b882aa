#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "simulation/world/world_file.h"

namespace livemap::simulation {

/// The road's middle line in the world frame (ENU, metres: x east, y north, z up; it starts at the
/// origin). Before its start and past its end it goes on straight and level. Immutable.
class RoadLine {
 public:
  RoadLine(double bearing_deg, const std::vector<RoadPiece>& pieces);

  /// `left_m` beside and `up_m` above the middle line, `along_m` from the start.
  Eigen::Vector3d At(double along_m, double left_m, double up_m) const;
  /// Direction of the road, radians counter-clockwise from east.
  double HeadingRad(double along_m) const;
  /// Rise per metre.
  double Slope(double along_m) const;
  /// Pose of a thing that stands on the road: x along it, y left, z up (not tilted by the slope).
  Eigen::Isometry3d Upright(double along_m, double left_m, double up_m) const;
  double length_m() const { return length_m_; }

 private:
  struct Sample {
    Eigen::Vector3d position;
    double heading_rad;
  };
  Sample Interpolate(double along_m) const;

  std::vector<Sample> samples_;
  double length_m_ = 0;
};

/// Straights, curves and hills for at least `length_m`, a pure function of the seed.
std::vector<RoadPiece> DrawRoad(std::uint64_t seed, double length_m);

}  // namespace livemap::simulation
