#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "geo/ground_projection.h"
#include "geo/vehicle_pose.h"
#include "imaging/box.h"

namespace livemap::placement {

/// A camera on a vehicle at the moment of one image.
struct PlacedCamera {
  geo::TrackPose base;  ///< Of base_link; its course is the heading.
  geo::CameraIntrinsics intrinsics;
  Eigen::Isometry3d base_from_optical = Eigen::Isometry3d::Identity();
};

/// How a place on the road appears to a camera.
struct ProjectedPlace {
  enum class Visibility {
    kInside,   ///< In the image, with the region in which it may lie.
    kOutside,  ///< Before the camera, but beside, above or below the image.
    kBehind,
  };
  Visibility visibility = Visibility::kBehind;
  double distance_m = 0;                            ///< From base_link, horizontal.
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< Unless kBehind.
  /// Of `pixel`: what place, pose, heading, pitch and pixel noise make of it.
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
};

/// Projects a place on the road, known with `covariance_m2` (east-north, m^2), into the image. It
/// is kInside when the pixel and two standard deviations around it keep `margin_share` of the
/// image's sides away from its edges. The road is the plane z = 0 of base_link.
ProjectedPlace ProjectPlace(const geo::GeoPoint& place, const Eigen::Matrix2d& covariance_m2,
                            const PlacedCamera& camera, const geo::GroundProjectionNoise& noise,
                            double margin_share);

/// Whether a detection's box can be the thing at the place that `view` shows: the middle of its
/// bottom edge lies within `gate_sigma` standard deviations of the place's pixel, or its own place
/// on the road within `radius_m` of `place`. Never one whose place on the road, seen from the
/// vehicle, is less certain than half that radius (standard deviation).
bool IsAtPlace(const imaging::Box& box, const geo::GeoPoint& place, const ProjectedPlace& view,
               const PlacedCamera& camera, const geo::GroundProjectionNoise& noise,
               double gate_sigma, double radius_m);

}  // namespace livemap::placement
