#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>

#include <Eigen/Geometry>
#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "geo/vehicle_pose.h"
#include "nodelets/bounded_tf_listener.h"

namespace livemap::nodelets {

/// What tf knows of a vehicle's frames (REP 105), for nodelets that place images. What is not known
/// is warned of, under the nodelet's name, once a while. Any thread.
class VehicleTf {
 public:
  /// `max_stamp_ahead_s`: see StampGate::Config.
  VehicleTf(ros::NodeHandle& node, std::string nodelet_name, std::string map_frame,
            std::string base_frame, double max_stamp_ahead_s);

  /// A fused pose of base_link in the map frame, whose datum is that of its owner: tf earth -> map.
  std::optional<geo::TrackPose> FusedPose(const nav_msgs::Odometry& message) const;
  /// Pose of a camera's optical frame in base_link.
  std::optional<Eigen::Isometry3d> Mounting(const std::string& optical_frame) const;

  const tf2_ros::Buffer& buffer() const { return buffer_; }

 private:
  std::string nodelet_name_;
  std::string map_frame_;
  std::string base_frame_;
  tf2_ros::Buffer buffer_;
  BoundedTfListener listener_;
};

/// Learns the mountings of cameras from tf, and follows them: edge_vo may find out better. Not
/// thread-safe.
class MountingLearner {
 public:
  using OnMounting = std::function<void(const std::string& optical_frame,
                                        const Eigen::Isometry3d& base_from_optical)>;

  /// `vehicle_tf` outlives this.
  MountingLearner(const VehicleTf& vehicle_tf, OnMounting on_mounting)
      : vehicle_tf_(vehicle_tf), on_mounting_(std::move(on_mounting)) {}

  /// An image of this camera came. Its mounting is looked up unless it was within a second.
  void Want(const std::string& optical_frame);
  /// Looks up again what was wanted last and is not known yet.
  void Retry();

 private:
  const VehicleTf& vehicle_tf_;
  OnMounting on_mounting_;
  struct Known {
    Eigen::Isometry3d base_from_optical;
    std::chrono::steady_clock::time_point look_again;
  };
  std::map<std::string, Known> known_;
  std::string wanted_;  ///< Empty: none.
};

}  // namespace livemap::nodelets
