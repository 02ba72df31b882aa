#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <Eigen/Geometry>
#include <optional>
#include <string>

#include "vehicle/positioning/fix_track.h"

namespace livemap::nodelets {

/// What tf knows of a vehicle's frames (REP 105), for nodelets that place images. What is not known
/// is warned of, under the nodelet's name, once a while. Any thread.
class VehicleTf {
 public:
  VehicleTf(ros::NodeHandle& node, std::string nodelet_name, std::string map_frame,
            std::string base_frame);

  /// A fused pose of base_link in the map frame, whose datum is that of its owner: tf earth -> map.
  std::optional<geo::TrackPose> FusedPose(const nav_msgs::Odometry& message) const;
  /// Pose of a camera's optical frame in base_link.
  std::optional<Eigen::Isometry3d> Mounting(const std::string& optical_frame) const;

 private:
  std::string nodelet_name_;
  std::string map_frame_;
  std::string base_frame_;
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_;
};

}  // namespace livemap::nodelets
