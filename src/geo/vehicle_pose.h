#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "geo/wgs84.h"

namespace livemap::geo {

/// One answer of the satellite receiver.
struct Fix {
  std::int64_t stamp_ns = 0;
  bool has_fix = true;  ///< False: the receiver itself says that it has none.
  GeoPoint position;    ///< Of the antenna.
  /// Of the horizontal position, local east-north axes, m^2; nothing when the receiver gives none.
  std::optional<Eigen::Matrix2d> covariance_m2;
};

/// Where the antenna was at one moment and which way the vehicle drove.
struct TrackPose {
  GeoPoint position;
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();  ///< East-north axes.
  double course_rad = 0;                                    ///< Clockwise from true north.
  double course_variance_rad2 = 0;
  double speed_mps = 0;
  /// Covariance of position and course, m rad, where a track knows it.
  Eigen::Vector2d position_course = Eigen::Vector2d::Zero();
};

}  // namespace livemap::geo
