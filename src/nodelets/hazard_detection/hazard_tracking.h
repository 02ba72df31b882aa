#pragma once

#include <livemap/DetectionArray.h>
#include <ros/node_handle.h>
#include <sensor_msgs/CameraInfo.h>
#include <std_msgs/Header.h>
#include <tf2_ros/buffer.h>

#include <optional>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "nodelets/bounded_tf_listener.h"
#include "perception/inference/model_manifest.h"
#include "perception/tracking/object_tracker.h"
#include "ros/parameters/hazard_detection_parameters.h"

namespace livemap::nodelets {

/// The tracker of hazard_detection, fed with the camera's motion by tf. StartAnew, Add,
/// BestViewStamps and counters want one thread at a time.
class HazardTracking {
 public:
  HazardTracking(const ros_io::HazardTrackingConfig& config,
                 const perception::ModelManifest& manifest, ros::NodeHandle node,
                 double max_stamp_ahead_s);

  /// Time was set back: all tracks of before are dropped.
  void StartAnew() { tracker_.StartAnew(); }
  /// Events that are to be published after this image, one message per image of a best view.
  std::vector<DetectionArray> Add(const std::vector<perception::HazardDetection>& found,
                                  const std_msgs::Header& header, cv::Size size);
  /// Stamps of the images that show a living track best so far, and of these events.
  std::vector<ros::Time> BestViewStamps(const std::vector<DetectionArray>& events) const;
  const perception::ObjectTracker::Counters& counters() const { return tracker_.counters(); }
  /// Images whose camera motion was known.
  std::uint64_t frames_with_motion() const { return frames_with_motion_; }

 private:
  std::optional<perception::CameraMotion> MotionAt(const std_msgs::Header& header);
  std::optional<geometry_msgs::TransformStamped> PoseAt(const ros::Time& stamp);

  const ros_io::HazardTrackingConfig config_;
  const std::string model_;
  perception::ObjectTracker tracker_;
  std::uint64_t frames_with_motion_ = 0;
  tf2_ros::Buffer buffer_;
  BoundedTfListener listener_;
  Mutex mutex_;
  std::optional<geo::CameraIntrinsics> intrinsics_ GUARDED_BY(mutex_);
  ros::Subscriber info_;
};

}  // namespace livemap::nodelets
