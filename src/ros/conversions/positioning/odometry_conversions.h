#pragma once

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/PointCloud2.h>

#include <string>

#include "odometry/edge/edge_odometry.h"

namespace livemap::ros_io {

/// Variance of what nobody measured, as REP 105's users write it.
constexpr double kUnknownVariance = 1e6;

/// Where odometry's poses belong to (REP 105).
struct OdometryFrames {
  std::string odom = "odom";
  std::string base = "base_link";
  /// The camera's mounting. The odometry's world is the optical frame of the first keyframe; odom
  /// is where base_link was then.
  Eigen::Isometry3d base_from_optical = Eigen::Isometry3d::Identity();
  /// Not the identity once the mounting has changed (ChangeMounting).
  Eigen::Isometry3d odom_from_first_base = Eigen::Isometry3d::Identity();
};

/// The camera turns out to be mounted otherwise, while it is at `world_from_camera`. The path goes
/// on where it was and into the same direction; odom stays level.
void ChangeMounting(const Eigen::Isometry3d& world_from_camera,
                    const Eigen::Isometry3d& base_from_optical, OdometryFrames& frames);

/// Pose of base_link in odom.
Eigen::Isometry3d OdomFromBase(const odometry::VoResult& result, const OdometryFrames& frames);

/// The message with both covariances: the pose's about odom's fixed axes, the twist's in base_link.
/// Where there is no twist, its covariance's diagonal is 1e6: unknown.
nav_msgs::Odometry ToOdometry(const odometry::VoResult& result, const OdometryFrames& frames,
                              const ros::Time& stamp);

/// The keyframe's edge points in odom with their grey values as intensity, thinned to one point per
/// cube of `voxel_m` (0: all). `world_from_keyframe` is its pose in metres, and `metres_per_unit`
/// what the unit of its points is.
sensor_msgs::PointCloud2 ToEdgeCloud(const odometry::Keyframe& keyframe,
                                     const Eigen::Isometry3d& world_from_keyframe,
                                     double metres_per_unit, const OdometryFrames& frames,
                                     double voxel_m, const ros::Time& stamp);

}  // namespace livemap::ros_io
