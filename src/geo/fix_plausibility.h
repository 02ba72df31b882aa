#pragma once

#include <Eigen/Core>

#include "geo/vehicle_pose.h"

namespace livemap::geo {

/// Whether a fix can be one at all, whatever its neighbours say: its stamp is after 1970, its
/// position is on the earth, its covariance is one (see IsFixCovariance) where it is stated, and it
/// does not lie where receivers without a position put it, at 0 degrees north and east ("null
/// island", in the sea). Says nothing of `has_fix`.
bool IsPlausible(const Fix& fix);

/// Covariance of a plausible fix to compute with, m^2. A receiver that states none, or none above a
/// millimetre on some axis, which no receiver has, gets `default_sigma_m` per axis.
Eigen::Matrix2d CovarianceOf(const Fix& fix, double default_sigma_m);

/// A position of the receiver with its uncertainty.
struct ReceiverPoint {
  std::int64_t stamp_ns = 0;
  GeoPoint position;
  double sigma_m = 0;  ///< Per axis.
};

/// Whether a vehicle of at most this speed can have been at both, as far as they are certain.
bool AreReachable(const ReceiverPoint& a, const ReceiverPoint& b, double max_speed_mps);

}  // namespace livemap::geo
