#include "nodelets/vehicle_tf.h"

#include <tf2_eigen/tf2_eigen.h>

#include <utility>

#include "common/error.h"
#include "geo/datum.h"
#include "nodelets/nodelet_support.h"
#include "ros/conversions/positioning/localization_conversions.h"

namespace livemap::nodelets {
namespace {

constexpr std::chrono::seconds kLookAgain(1);

}  // namespace

VehicleTf::VehicleTf(ros::NodeHandle& node, std::string nodelet_name, std::string map_frame,
                     std::string base_frame, double max_stamp_ahead_s)
    : nodelet_name_(std::move(nodelet_name)),
      map_frame_(std::move(map_frame)),
      base_frame_(std::move(base_frame)),
      listener_(buffer_, node, max_stamp_ahead_s) {}

std::optional<geo::TrackPose> VehicleTf::FusedPose(const nav_msgs::Odometry& message) const {
  if (message.header.frame_id != map_frame_ || message.child_frame_id != base_frame_) {
    ROS_WARN_THROTTLE(kSayAgainS,
                      "%s: dropped a fused pose of '%s' in '%s': wanted is '%s' in '%s'",
                      nodelet_name_.c_str(), message.child_frame_id.c_str(),
                      message.header.frame_id.c_str(), base_frame_.c_str(), map_frame_.c_str());
    return std::nullopt;
  }
  try {
    const auto transform = buffer_.lookupTransform("earth", map_frame_, ros::Time(0));
    const geo::LocalFrame map(geo::DatumOf(Eigen::Isometry3d(tf2::transformToEigen(transform))));
    return ros_io::ToTrackPose(message, map);
  } catch (const tf2::TransformException& error) {
    ROS_WARN_THROTTLE(kSayAgainS, "%s: dropped a fused pose: %s", nodelet_name_.c_str(),
                      error.what());
  } catch (const Error& error) {
    ROS_WARN_THROTTLE(kSayAgainS, "%s: dropped a fused pose: %s", nodelet_name_.c_str(),
                      error.what());
  }
  return std::nullopt;
}

std::optional<Eigen::Isometry3d> VehicleTf::Mounting(const std::string& optical_frame) const {
  try {
    return Eigen::Isometry3d(
        tf2::transformToEigen(buffer_.lookupTransform(base_frame_, optical_frame, ros::Time(0))));
  } catch (const tf2::TransformException& error) {
    ROS_WARN_THROTTLE(kSayAgainS, "%s: no mounting of the camera yet: %s", nodelet_name_.c_str(),
                      error.what());
    return std::nullopt;
  }
}

void MountingLearner::Want(const std::string& optical_frame) {
  const auto known = known_.find(optical_frame);
  if (known != known_.end() && std::chrono::steady_clock::now() < known->second.look_again) return;
  wanted_ = optical_frame;
  Retry();
}

void MountingLearner::Retry() {
  if (wanted_.empty()) return;
  const std::optional<Eigen::Isometry3d> mounting = vehicle_tf_.Mounting(wanted_);
  if (!mounting) return;
  const auto known = known_.find(wanted_);
  const bool changed =
      known == known_.end() || !known->second.base_from_optical.isApprox(*mounting, 1e-9);
  known_[wanted_] = {*mounting, std::chrono::steady_clock::now() + kLookAgain};
  if (changed) on_mounting_(wanted_, *mounting);
  wanted_.clear();
}

}  // namespace livemap::nodelets
