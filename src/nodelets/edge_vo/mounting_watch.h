#pragma once

#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "nodelets/diagnostics.h"
#include "odometry/mounting/mounting_keeper.h"
#include "ros/parameters/positioning/edge_vo_parameters.h"

namespace livemap::nodelets {

/// The camera's mounting on board: that of tf until what the camera found out is surer. Tells the
/// latter on `camera/mounting` and, where it is wanted, on tf. Not thread-safe.
class MountingWatch {
 public:
  /// `name` is the nodelet's, for the log.
  MountingWatch(ros::NodeHandle& node, std::string name, const ros_io::EdgeVoConfig& config,
                const tf2_ros::Buffer& buffer);
  /// Keeps what it found.
  ~MountingWatch();

  /// The camera that images of this frame come from, and how it is to be taken to be mounted. tf's
  /// mounting counts as it was when the first camera began. Throws tf2::TransformException while tf
  /// does not know it.
  Eigen::Isometry3d Begin(const std::string& optical_frame, const geo::CameraIntrinsics& camera);

  /// A followed frame. Returns the mounting to use from now on where that changed.
  std::optional<Eigen::Isometry3d> Add(const odometry::CalibrationFrame& frame);

  void Diagnose(Diagnostics::Status& status) const;
  /// That the camera was knocked during this drive or since the last one; empty: it was not.
  std::string Complaint() const;

 private:
  void LookUp(const std::string& optical_frame);
  Eigen::Isometry3d BaseFromOptical(const odometry::Mounting& mounting) const;
  bool HasChanged(const odometry::Mounting& mounting) const;
  void Tell(std::int64_t stamp_ns);
  void TellTf(const Eigen::Isometry3d& base_from_optical);
  void SayKnock(const odometry::MountingKnock& knock);

  std::string name_;
  ros_io::EdgeVoConfig config_;
  const tf2_ros::Buffer& buffer_;
  ros::Publisher publisher_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  std::string optical_frame_;
  Eigen::Isometry3d of_tf_ = Eigen::Isometry3d::Identity();
  std::string top_frame_;  ///< Of the camera's frames, the one below base_frame.
  Eigen::Isometry3d top_from_optical_ = Eigen::Isometry3d::Identity();
  std::unique_ptr<odometry::MountingKeeper> keeper_;
  odometry::Mounting used_;
  std::int64_t told_ns_ = 0;
};

}  // namespace livemap::nodelets
