#include "nodelets/vehicle_feed.h"

#include <image_transport/image_transport.h>

#include <boost/function.hpp>
#include <optional>
#include <utility>

#include "common/error.h"
#include "nodelets/nodelet_support.h"
#include "ros/conversions/camera_info_conversions.h"
#include "ros/conversions/hazard_conversions.h"

namespace livemap::nodelets {

VehicleFeed::VehicleFeed(ros::NodeHandle& node, ros::NodeHandle& private_node, const Config& config,
                         Mutex& mutex, Handlers handlers)
    : mutex_(mutex),
      handlers_(std::move(handlers)),
      nodelet_name_(config.nodelet_name),
      image_topic_(node.resolveName("camera_rect/image")),
      stamps_(config.nodelet_name, config.max_stamp_ahead_s, handlers_.on_time_reset),
      vehicle_tf_(node, config.nodelet_name, config.map_frame, config.base_frame,
                  config.max_stamp_ahead_s),
      mountings_(vehicle_tf_, handlers_.on_mounting) {
  subscribers_ = {
      node.subscribe("fix", 100, &VehicleFeed::OnFix, this),
      node.subscribe("camera_rect/camera_info", 1, &VehicleFeed::OnCameraInfo, this),
  };
  if (config.use_fused) {
    subscribers_.push_back(
        node.subscribe("localization/odometry", 100, &VehicleFeed::OnPose, this));
  }
  image_transport::ImageTransport transport(node);
  const image_transport::TransportHints hints("raw", ros::TransportHints().tcpNoDelay(),
                                              private_node);
  // No bound of ROS's, which would lose frames without a word: the nodelet's own queue has one, and
  // counts.
  image_subscriber_ =
      transport.subscribe("camera_rect/image", 0,
                          boost::function<void(const sensor_msgs::ImageConstPtr&)>(
                              [this](const sensor_msgs::ImageConstPtr& image) { OnImage(image); }),
                          ros::VoidPtr(), hints);
}

void VehicleFeed::OnFix(const sensor_msgs::NavSatFix& message) {
  const MutexLock lock(mutex_);
  if (stamps_.IsUsable("a fix", message.header.stamp)) handlers_.on_fix(ros_io::ToFix(message));
}

void VehicleFeed::OnPose(const nav_msgs::Odometry& message) {
  const std::optional<geo::TrackPose> pose = vehicle_tf_.FusedPose(message);
  if (!pose) return;
  const MutexLock lock(mutex_);
  if (!stamps_.IsUsable("a fused pose", message.header.stamp)) return;
  handlers_.on_pose(ros_io::FromRosTime(message.header.stamp), *pose);
}

void VehicleFeed::OnCameraInfo(const sensor_msgs::CameraInfo& message) {
  try {
    const geo::CameraIntrinsics intrinsics = ros_io::ToRectifiedIntrinsics(message);
    const MutexLock lock(mutex_);
    handlers_.on_intrinsics(intrinsics);
  } catch (const Error& error) {
    ROS_WARN_THROTTLE(kSayAgainS, "%s: dropped: %s", nodelet_name_.c_str(), error.what());
  }
}

void VehicleFeed::OnImage(const sensor_msgs::ImageConstPtr& image) {
  const MutexLock lock(mutex_);
  if (!stamps_.IsUsable("an image", image->header.stamp)) return;
  mountings_.Want(image->header.frame_id);
  handlers_.on_image(image);
}

}  // namespace livemap::nodelets
