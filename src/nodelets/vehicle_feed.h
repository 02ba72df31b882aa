#pragma once

#include <image_transport/subscriber.h>
#include <nav_msgs/Odometry.h>
#include <ros/node_handle.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/NavSatFix.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "geo/camera_intrinsics.h"
#include "geo/vehicle_pose.h"
#include "nodelets/diagnostics.h"
#include "nodelets/stamp_checks.h"
#include "nodelets/vehicle_tf.h"

namespace livemap::nodelets {

/// What a nodelet that places camera images listens to: fixes, fused poses, the calibration of the
/// rectified camera, its mounting, and its images. What cannot be used, or has a stamp that cannot
/// be, is warned of and dropped.
/// The handlers are called in the queue of `node`, each with the nodelet's mutex held: a handler
/// that uses what the mutex guards says so to the thread-safety analysis by Mutex::AssertHeld.
///
/// Typical usage: a nodelet's start makes one when all that the handlers use stands, and before the
/// subscribers and timers that use it; the destructor stops these, and calls StopImages before it
/// ends the threads to which the images go.
class VehicleFeed {
 public:
  struct Config {
    std::string nodelet_name;  ///< In warnings.
    std::string map_frame = "map";
    std::string base_frame = "base_link";
    bool use_fused = false;        ///< Whether to listen to localization/odometry.
    double max_stamp_ahead_s = 5;  ///< See StampGate::Config.
  };

  struct Handlers {
    std::function<void(const geo::Fix& fix)> on_fix;
    /// A fused pose of base_link.
    std::function<void(std::int64_t stamp_ns, const geo::TrackPose& pose)> on_pose;
    std::function<void(const geo::CameraIntrinsics& intrinsics)> on_intrinsics;
    MountingLearner::OnMounting on_mounting;
    /// Every image, after the mounting of its camera where that is known.
    std::function<void(const sensor_msgs::ImageConstPtr& image)> on_image;
    /// Time went back: nothing of before can be compared with what comes.
    std::function<void()> on_time_reset;
  };

  /// `mutex` is the nodelet's and outlives this.
  VehicleFeed(ros::NodeHandle& node, ros::NodeHandle& private_node, const Config& config,
              Mutex& mutex, Handlers handlers);

  /// No image comes after it returns. The mutex is not held.
  void StopImages() EXCLUDES(mutex_) { image_subscriber_.shutdown(); }
  /// The resolved name. Any thread.
  const std::string& image_topic() const { return image_topic_; }
  /// Whether an image of another topic is of use. The nodelet's mutex is held: on_time_reset may be
  /// called.
  bool IsUsable(const std::string& input, const ros::Time& stamp) {
    return stamps_.IsUsable(input, stamp);
  }
  /// Adds what was refused. Any thread.
  void Diagnose(Diagnostics::Status& status) const { stamps_.Diagnose(status); }

 private:
  void OnFix(const sensor_msgs::NavSatFix& message);
  void OnPose(const nav_msgs::Odometry& message);
  void OnCameraInfo(const sensor_msgs::CameraInfo& message);
  void OnImage(const sensor_msgs::ImageConstPtr& image);

  Mutex& mutex_;
  Handlers handlers_ GUARDED_BY(mutex_);
  std::string nodelet_name_;
  std::string image_topic_;
  StampChecks stamps_;
  VehicleTf vehicle_tf_;
  MountingLearner mountings_ GUARDED_BY(mutex_);
  std::vector<ros::Subscriber> subscribers_;
  image_transport::Subscriber image_subscriber_;
};

}  // namespace livemap::nodelets
