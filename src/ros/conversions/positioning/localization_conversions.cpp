#include "ros/conversions/positioning/localization_conversions.h"

#include <tf2_eigen/tf2_eigen.h>

#include <array>
#include <cmath>
#include <limits>

#include "common/time.h"
#include "geo/datum.h"
#include "localization/planar.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/positioning/odometry_conversions.h"

namespace livemap::ros_io {
namespace {

constexpr double kLostVariance = 1e5;
// Of ROS's (x, y, z, roll, pitch, yaw), those of a plane.
constexpr std::array<std::size_t, 3> kPlanar = {0, 1, 5};

std::size_t LocalizationCovarianceIndex(std::size_t row, std::size_t column) {
  return 6 * row + column;
}

Eigen::Matrix3d LocalizationPlanarPart(const boost::array<double, 36>& covariance) {
  Eigen::Matrix3d part;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      part(static_cast<int>(row), static_cast<int>(column)) =
          covariance[LocalizationCovarianceIndex(kPlanar.at(row), kPlanar.at(column))];
    }
  }
  return part;
}

}  // namespace

localization::OdometrySample ToOdometrySample(const nav_msgs::Odometry& message,
                                              std::optional<std::int64_t> previous_ns) {
  localization::OdometrySample sample;
  sample.stamp_ns = FromRosTime(message.header.stamp);
  const auto& rotation = message.pose.pose.orientation;
  // Not normalised: what is no unit quaternion makes no rotation, and is refused.
  sample.odom_from_base.linear() =
      Eigen::Quaterniond(rotation.w, rotation.x, rotation.y, rotation.z).toRotationMatrix();
  const auto& position = message.pose.pose.position;
  sample.odom_from_base.translation() = Eigen::Vector3d(position.x, position.y, position.z);
  const Eigen::Matrix3d twist = LocalizationPlanarPart(message.twist.covariance);
  sample.lost = twist.diagonal().maxCoeff() >= kLostVariance;
  const bool stated = twist.diagonal().minCoeff() > 0;
  if (previous_ns && *previous_ns < sample.stamp_ns && stated && !sample.lost) {
    const double time_s = Seconds(sample.stamp_ns - *previous_ns);
    sample.increment_covariance = time_s * time_s * twist;
  }
  return sample;
}

sensor_msgs::NavSatFix ToFusedFix(const localization::FusedPose& fused,
                                  const std::string& base_frame, std::int64_t stamp_ns) {
  sensor_msgs::NavSatFix message;
  message.header.stamp = ToRosTime(stamp_ns);
  message.header.frame_id = base_frame;
  message.status.status = sensor_msgs::NavSatStatus::STATUS_FIX;
  message.latitude = fused.position.latitude_deg;
  message.longitude = fused.position.longitude_deg;
  message.altitude = std::numeric_limits<double>::quiet_NaN();
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_KNOWN;
  message.position_covariance = {fused.covariance_m2(0, 0),
                                 fused.covariance_m2(0, 1),
                                 0,
                                 fused.covariance_m2(1, 0),
                                 fused.covariance_m2(1, 1),
                                 0,
                                 0,
                                 0,
                                 kUnknownVariance};
  return message;
}

nav_msgs::Odometry ToFusedOdometry(const localization::FusedPose& fused,
                                   const Eigen::Isometry3d& map_from_odom,
                                   const localization::OdometrySample& sample,
                                   const nav_msgs::Odometry& odometry,
                                   const std::string& map_frame) {
  nav_msgs::Odometry message;
  message.header.stamp = odometry.header.stamp;
  message.header.frame_id = map_frame;
  message.child_frame_id = odometry.child_frame_id;
  message.pose.pose = tf2::toMsg(Eigen::Isometry3d(map_from_odom * sample.odom_from_base));
  for (std::size_t axis = 2; axis < 5; ++axis) {
    message.pose.covariance[LocalizationCovarianceIndex(axis, axis)] = kUnknownVariance;
  }
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      message.pose.covariance[LocalizationCovarianceIndex(kPlanar.at(row), kPlanar.at(column))] =
          fused.map_covariance(static_cast<int>(row), static_cast<int>(column));
    }
  }
  message.twist = odometry.twist;
  return message;
}

geo::TrackPose ToTrackPose(const nav_msgs::Odometry& message, const geo::LocalFrame& map) {
  const auto& rotation = message.pose.pose.orientation;
  const auto& place = message.pose.pose.position;
  const Eigen::Vector3d forward =
      Eigen::Quaterniond(rotation.w, rotation.x, rotation.y, rotation.z) * Eigen::Vector3d::UnitX();
  geo::TrackPose pose;
  pose.position = map.ToGeo({place.x, place.y});
  const double convergence_rad = geo::MeridianConvergence(map, pose.position);
  // Clockwise from north, as the map's axes lie there.
  pose.course_rad = std::atan2(forward.x(), forward.y()) + convergence_rad;
  const Eigen::Matrix2d turn = localization::Rotation2(-convergence_rad);
  const Eigen::Matrix3d covariance = LocalizationPlanarPart(message.pose.covariance);
  pose.covariance_m2 = turn * covariance.topLeftCorner<2, 2>() * turn.transpose();
  pose.course_variance_rad2 = covariance(2, 2);
  pose.position_course = -(turn * covariance.topRightCorner<2, 1>());
  pose.speed_mps = std::abs(message.twist.twist.linear.x);
  return pose;
}

const char* LocalizerStateName(localization::LocalizerState state) {
  switch (state) {
    case localization::LocalizerState::kUninitialised:
      return "uninitialised";
    case localization::LocalizerState::kOk:
      return "ok";
    case localization::LocalizerState::kDeadReckoning:
      return "dead reckoning";
  }
  return "?";
}

const char* RefusalReason(localization::GeoLocalizer::FixVerdict verdict) {
  using FixVerdict = localization::GeoLocalizer::FixVerdict;
  switch (verdict) {
    case FixVerdict::kRefused:
      return "it is too far from where odometry and the other fixes foretell it";
    case FixVerdict::kAbsent:
      return "the receiver says that it has no fix";
    case FixVerdict::kInvalid:
      return "its stamp, position or covariance cannot be, or it is too far from the datum";
    case FixVerdict::kOutOfOrder:
      return "its stamp is not later than the one before, or older than the window";
    case FixVerdict::kWithoutOdometry:
      return "there is no odometry of its moment";
    case FixVerdict::kUsed:
    case FixVerdict::kKept:
    case FixVerdict::kWaiting:
      break;
  }
  return nullptr;
}

void DescribeLocalizer(const localization::GeoLocalizer& localizer,
                       diagnostic_updater::DiagnosticStatusWrapper& status) {
  const localization::LocalizerCounters& counters = localizer.counters();
  status.add("fixes_used", counters.fixes_used);
  status.add("fixes_refused", counters.fixes_refused);
  status.add("fixes_absent", counters.fixes_absent);
  status.add("fixes_invalid", counters.fixes_invalid);
  status.add("fixes_out_of_order", counters.fixes_out_of_order);
  status.add("fixes_without_odometry", counters.fixes_without_odometry);
  status.add("odometry_invalid", counters.odometry_invalid);
  status.add("odometry_out_of_order", counters.odometry_out_of_order);
  status.add("odometry_resets", counters.odometry_resets);
  status.add("restarts", counters.restarts);
  status.add("datum_changes", counters.datum_changes);
  status.add("window_poses", localizer.window_nodes());
  status.add("fix_scatter", localizer.widening());
  const localization::LatencyEstimate latency = localizer.latency();
  status.add("latency_s", latency.value_s);
  status.add("latency_sigma_s", latency.sigma_s);
  status.add("latency_observed", latency.observed);
  status.add("odometry_scale", localizer.odometry_scale());
  status.add("yaw_bias_rps", localizer.yaw_bias_rps());
}

}  // namespace livemap::ros_io
