#pragma once

#include <Eigen/Core>

#include "geo/ground_projection.h"
#include "geo/vehicle_pose.h"
#include "geo/wgs84.h"

namespace livemap::placement {

/// A place on the map with its uncertainty.
struct PlacedHazard {
  geo::GeoPoint position;
  Eigen::Matrix2d covariance_m2;  ///< East-north axes, m^2.
};

/// Puts a point of the road that the camera saw on the map.
///
/// `antenna` is where the antenna was and which way the vehicle drove, `antenna_in_base_m` the
/// antenna's place in base_link (x forward, y left, metres) and `ground` the point in base_link.
/// The covariance sums those of the fix and of the projection and what the course's error does at
/// that distance, to first order. Assumes that the vehicle drives the way it points.
PlacedHazard PlaceHazard(const geo::TrackPose& antenna, const Eigen::Vector2d& antenna_in_base_m,
                         const geo::GroundPoint& ground);

/// The middle of a thing whose foot, the edge on the road that the camera sees, was placed: by
/// `half_depth_m` farther along the line from `seen_from`, where the vehicle was. How deep things
/// of a class are differs by half of it, say, which the covariance has. A foot that is nearer than
/// 1 m stays.
PlacedHazard MiddleOf(const PlacedHazard& foot, const geo::GeoPoint& seen_from,
                      double half_depth_m);

}  // namespace livemap::placement
