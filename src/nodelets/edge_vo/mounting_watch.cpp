#include "nodelets/edge_vo/mounting_watch.h"

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <tf2_eigen/tf2_eigen.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/time.h"
#include "geo/wgs84.h"
#include "nodelets/nodelet_support.h"
#include "ros/conversions/hazard_conversions.h"

namespace livemap::nodelets {
namespace {

/// A mounting that differs by less is the same.
constexpr double kSameMountingRad = 0.1 * geo::kRadiansPerDegree;
constexpr double kSameMountingM = 0.01;
/// tf is told again for listeners that have heard the first mounting last.
constexpr double kTellAgainS = 5;

odometry::MountingKeeper::Config KeeperConfigOf(const ros_io::EdgeVoConfig& config,
                                                const Eigen::Isometry3d& base_from_optical) {
  odometry::MountingKeeper::Config keeper;
  keeper.path = config.mounting_file;
  keeper.parameter_sigma_rad = config.mounting_sigma_rad;
  keeper.parameter_sigma_m = config.mounting_sigma_m;
  keeper.calibrator.assumed = odometry::MountingOfRotation(base_from_optical.linear());
  keeper.calibrator.forward_m = base_from_optical.translation().x();
  keeper.calibrator.left_m = base_from_optical.translation().y();
  keeper.calibrator.assumed.height_m = base_from_optical.translation().z();
  return keeper;
}

double DegreesOfMounting(double rad) { return rad / geo::kRadiansPerDegree; }

}  // namespace

MountingWatch::MountingWatch(ros::NodeHandle& node, std::string name,
                             const ros_io::EdgeVoConfig& config, const tf2_ros::Buffer& buffer)
    : name_(std::move(name)),
      config_(config),
      buffer_(buffer),
      publisher_(
          node.advertise<geometry_msgs::PoseWithCovarianceStamped>("camera/mounting", 1, true)) {}

MountingWatch::~MountingWatch() {
  if (keeper_) keeper_->Save();
}

/// tf's mounting, and which of the camera's frames stands below base_frame.
void MountingWatch::LookUp(const std::string& optical_frame) {
  const ros::Time latest(0);
  const Eigen::Isometry3d of_tf =
      tf2::transformToEigen(buffer_.lookupTransform(config_.base_frame, optical_frame, latest));
  std::string parent;
  top_frame_ = optical_frame;
  while (buffer_._getParent(top_frame_, latest, parent) && parent != config_.base_frame) {
    top_frame_ = parent;
  }
  top_from_optical_ =
      tf2::transformToEigen(buffer_.lookupTransform(top_frame_, optical_frame, latest));
  of_tf_ = of_tf;
  optical_frame_ = optical_frame;
  keeper_.reset();
}

Eigen::Isometry3d MountingWatch::Begin(const std::string& optical_frame,
                                       const geo::CameraIntrinsics& camera) {
  if (keeper_ && optical_frame_ == optical_frame && keeper_->IsOf(camera)) {
    return BaseFromOptical(used_);
  }
  if (keeper_) keeper_->Save();
  if (optical_frame_ != optical_frame) LookUp(optical_frame);
  if (!config_.calibrate_mounting) return of_tf_;
  keeper_.reset();
  try {
    keeper_ = std::make_unique<odometry::MountingKeeper>(KeeperConfigOf(config_, of_tf_), camera);
  } catch (const Error& error) {
    ROS_WARN("%s: the camera's mounting is not calibrated: %s", name_.c_str(), error.what());
    return of_tf_;
  }
  if (!keeper_->problem().empty()) ROS_WARN("%s: %s", name_.c_str(), keeper_->problem().c_str());
  const odometry::MountingInUse in_use = keeper_->InUse();
  used_ = in_use.mounting;
  told_ns_ = 0;
  return in_use.found ? BaseFromOptical(used_) : of_tf_;
}

std::optional<Eigen::Isometry3d> MountingWatch::Add(const odometry::CalibrationFrame& frame) {
  if (!keeper_) return std::nullopt;
  keeper_->Add(frame);
  if (const auto knock = keeper_->TakeKnock()) SayKnock(*knock);
  const odometry::MountingInUse in_use = keeper_->InUse();
  if (!in_use.found && !HasChanged(in_use.mounting)) return std::nullopt;
  const bool changed = HasChanged(in_use.mounting);
  if (changed) used_ = in_use.mounting;
  const double age_s = Seconds(frame.stamp_ns - told_ns_);
  if (changed || told_ns_ == 0 || age_s < 0 || age_s > kTellAgainS) Tell(frame.stamp_ns);
  if (!changed) return std::nullopt;
  return BaseFromOptical(used_);
}

bool MountingWatch::HasChanged(const odometry::Mounting& mounting) const {
  return std::abs(mounting.yaw_rad - used_.yaw_rad) > kSameMountingRad ||
         std::abs(mounting.pitch_rad - used_.pitch_rad) > kSameMountingRad ||
         std::abs(mounting.roll_rad - used_.roll_rad) > kSameMountingRad ||
         std::abs(mounting.height_m - used_.height_m) > kSameMountingM;
}

Eigen::Isometry3d MountingWatch::BaseFromOptical(const odometry::Mounting& mounting) const {
  Eigen::Isometry3d pose = of_tf_;
  pose.linear() = odometry::BaseFromOpticalRotation(mounting);
  pose.translation().z() = mounting.height_m;
  return pose;
}

/// The covariance is about the axes of base_link, as REP 103 has them.
void MountingWatch::Tell(std::int64_t stamp_ns) {
  constexpr std::size_t kZ = 14, kRoll = 21, kPitch = 28, kYaw = 35;
  told_ns_ = stamp_ns;
  const Eigen::Isometry3d base_from_optical = BaseFromOptical(used_);
  const odometry::Mounting sigma = keeper_->InUse().sigma;
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header.stamp = ros_io::ToRosTime(stamp_ns);
  message.header.frame_id = config_.base_frame;
  message.pose.pose = tf2::toMsg(base_from_optical);
  message.pose.covariance[kZ] = sigma.height_m * sigma.height_m;
  message.pose.covariance[kRoll] = sigma.roll_rad * sigma.roll_rad;
  message.pose.covariance[kPitch] = sigma.pitch_rad * sigma.pitch_rad;
  message.pose.covariance[kYaw] = sigma.yaw_rad * sigma.yaw_rad;
  publisher_.publish(message);
  if (config_.publish_mounting) TellTf(base_from_optical);
}

void MountingWatch::TellTf(const Eigen::Isometry3d& base_from_optical) {
  geometry_msgs::TransformStamped transform =
      tf2::eigenToTransform(base_from_optical * top_from_optical_.inverse());
  transform.header.frame_id = config_.base_frame;
  transform.header.stamp = ros::Time::now();
  transform.child_frame_id = top_frame_;
  broadcaster_.sendTransform(transform);
}

void MountingWatch::SayKnock(const odometry::MountingKnock& knock) {
  const odometry::Mounting &before = knock.before, &after = knock.after;
  ROS_WARN(
      "%s: the camera was knocked: yaw %.2f -> %.2f, pitch %.2f -> %.2f, roll %.2f -> %.2f "
      "degrees, height %.2f -> %.2f m; its mounting is found anew",
      name_.c_str(), DegreesOfMounting(before.yaw_rad), DegreesOfMounting(after.yaw_rad),
      DegreesOfMounting(before.pitch_rad), DegreesOfMounting(after.pitch_rad),
      DegreesOfMounting(before.roll_rad), DegreesOfMounting(after.roll_rad), before.height_m,
      after.height_m);
}

std::string MountingWatch::Complaint() const {
  return keeper_ && keeper_->knocks() > 0 ? "the camera was knocked" : "";
}

void MountingWatch::Diagnose(Diagnostics::Status& status) const {
  odometry::MountingInUse in_use;
  if (keeper_) in_use = keeper_->InUse();
  status.add("mounting", !keeper_ ? "tf" : in_use.found ? "found" : "parameters");
  const auto add = [&](const char* key, double value) {
    status.add(key, keeper_ ? std::to_string(value) : std::string());
  };
  add("mounting_yaw_deg", DegreesOfMounting(in_use.mounting.yaw_rad));
  add("mounting_yaw_sigma_deg", DegreesOfMounting(in_use.sigma.yaw_rad));
  add("mounting_pitch_deg", DegreesOfMounting(in_use.mounting.pitch_rad));
  add("mounting_pitch_sigma_deg", DegreesOfMounting(in_use.sigma.pitch_rad));
  add("mounting_roll_deg", DegreesOfMounting(in_use.mounting.roll_rad));
  add("mounting_roll_sigma_deg", DegreesOfMounting(in_use.sigma.roll_rad));
  add("mounting_height_m", in_use.mounting.height_m);
  add("mounting_height_sigma_m", in_use.sigma.height_m);
  status.add("mounting_knocks", keeper_ ? keeper_->knocks() : 0);
  status.add("mounting_problem", keeper_ ? keeper_->problem() : std::string());
}

}  // namespace livemap::nodelets
