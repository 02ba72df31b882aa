#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "localization/odometry_track.h"

namespace livemap::localization {

/// A fix as the window sees it, tied to the node before it.
struct FixMeasurement {
  std::int64_t stamp_ns = 0;
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();  ///< Of the antenna, map.
  /// Root of the information of the part that is new at every fix, as stated: R^-1 = S^T S.
  Eigen::Matrix2d root_information = Eigen::Matrix2d::Identity();
  double shared_m = 0;  ///< Standard deviation of the shared part.
  /// From the node to stamp - latency_s, in the node's frame, and the velocity then.
  PlanarMotion motion;
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();
  Eigen::Vector2d reported_velocity_mps = Eigen::Vector2d::Zero();  ///< With its noise.
  double latency_s = 0;
  double widening = 1;  ///< The fix scatters so much wider than stated.
  bool used = true;
};

}  // namespace livemap::localization
