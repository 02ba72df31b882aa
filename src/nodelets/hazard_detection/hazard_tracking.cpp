#include "nodelets/hazard_detection/hazard_tracking.h"

#include <tf2_eigen/tf2_eigen.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "nodelets/nodelet_support.h"
#include "ros/conversions/camera_info_conversions.h"
#include "ros/conversions/detection_conversions.h"

namespace livemap::nodelets {

HazardTracking::HazardTracking(const ros_io::HazardTrackingConfig& config,
                               const perception::ModelManifest& manifest, ros::NodeHandle node,
                               double max_stamp_ahead_s)
    : config_(config),
      model_(manifest.name),
      tracker_(config.tracker, manifest.thresholds),
      listener_(buffer_, node, max_stamp_ahead_s) {
  info_ = node.subscribe<sensor_msgs::CameraInfo>(
      "camera_rect/camera_info", 2, [this](const sensor_msgs::CameraInfo::ConstPtr& info) {
        try {
          const geo::CameraIntrinsics intrinsics = ros_io::ToRectifiedIntrinsics(*info);
          const MutexLock lock(mutex_);
          intrinsics_ = intrinsics;
        } catch (const Error& error) {
          ROS_WARN_THROTTLE(kSayAgainS, "tracking knows no camera: %s", error.what());
        }
      });
}

std::vector<DetectionArray> HazardTracking::Add(
    const std::vector<perception::HazardDetection>& found, const std_msgs::Header& header,
    cv::Size size) {
  perception::TrackerFrame frame;
  frame.stamp_ns = static_cast<std::int64_t>(header.stamp.toNSec());
  frame.image_size = size;
  frame.detections = found;
  frame.motion = MotionAt(header);
  if (frame.motion) ++frames_with_motion_;

  std::map<std::int64_t, std::vector<perception::ObjectEvent>> by_view;
  for (const perception::ObjectEvent& event : tracker_.Add(frame))
    by_view[event.stamp_ns].push_back(event);
  std::vector<DetectionArray> messages;
  for (const auto& [stamp_ns, events] : by_view) {
    std_msgs::Header view = header;
    view.stamp.fromNSec(static_cast<std::uint64_t>(stamp_ns));
    std::vector<perception::HazardDetection> detections;
    for (const perception::ObjectEvent& event : events) detections.push_back(event.detection);
    std::stable_sort(
        detections.begin(), detections.end(),
        [](const perception::HazardDetection& a, const perception::HazardDetection& b) {
          return a.confidence > b.confidence;
        });
    messages.push_back(ros_io::ToMessage(detections, view, model_, events.front().image_size, 0));
  }
  return messages;
}

std::vector<ros::Time> HazardTracking::BestViewStamps(
    const std::vector<DetectionArray>& events) const {
  std::vector<ros::Time> stamps;
  for (const std::int64_t stamp_ns : tracker_.BestViews()) {
    stamps.push_back(ros::Time().fromNSec(static_cast<std::uint64_t>(stamp_ns)));
  }
  for (const DetectionArray& event : events) stamps.push_back(event.header.stamp);
  return stamps;
}

std::optional<perception::CameraMotion> HazardTracking::MotionAt(const std_msgs::Header& header) {
  perception::CameraMotion motion;
  {
    const MutexLock lock(mutex_);
    if (!intrinsics_) return std::nullopt;
    motion.intrinsics = *intrinsics_;
  }
  const auto pose = PoseAt(header.stamp);
  if (!pose) return std::nullopt;
  try {
    motion.base_from_optical = tf2::transformToEigen(
        buffer_.lookupTransform(config_.base_frame, header.frame_id, ros::Time(0)));
  } catch (const tf2::TransformException&) {
    return std::nullopt;
  }
  motion.world_from_base = tf2::transformToEigen(*pose);
  return motion;
}

/// Odometry may come later than the detector: then the newest pose serves, whose lag is nearly the
/// same at the next image, so that the way between the two is right.
std::optional<geometry_msgs::TransformStamped> HazardTracking::PoseAt(const ros::Time& stamp) {
  const auto look = [&](const ros::Time& at) {
    return buffer_.lookupTransform(config_.motion_frame, config_.base_frame, at);
  };
  try {
    return look(stamp);
  } catch (const tf2::TransformException&) {
  }
  try {
    const geometry_msgs::TransformStamped newest = look(ros::Time(0));
    const double age_s = (stamp - newest.header.stamp).toSec();
    if (std::abs(age_s) <= config_.motion_max_age_s) return newest;
  } catch (const tf2::TransformException&) {
  }
  return std::nullopt;
}

}  // namespace livemap::nodelets
