#include "nodelets/hazard_reporting/vehicle_view.h"

#include <livemap/VehiclePosition.h>
#include <ros/console.h>
#include <tf2_eigen/tf2_eigen.h>
#include <visualization_msgs/MarkerArray.h>

#include <cmath>
#include <cstddef>

#include "nodelets/nodelet_support.h"
#include "placement/hazard_placement.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/positioning/localization_conversions.h"
#include "ros/views/hazard_view.h"

namespace livemap::nodelets {
namespace {

constexpr double kMaxRangeM = 100e3;  // Of a map that nobody else has chosen.

}  // namespace

VehicleView::VehicleView(const ros_io::HazardReportingConfig& config,
                         const vehicle::HazardReporter& reporter,
                         const protocol::HazardCatalogue& catalogue, ros::NodeHandle& node)
    : config_(config), reporter_(reporter), catalogue_(catalogue) {
  if (config_.map_datum) map_.emplace(*config_.map_datum);
  path_.header.frame_id = config_.map_frame;
  position_publisher_ = node.advertise<VehiclePosition>("vehicle/position", 10);
  marker_publisher_ = node.advertise<visualization_msgs::MarkerArray>("hazard/local_map", 1);
  path_publisher_ = node.advertise<nav_msgs::Path>("path", 1);
}

void VehicleView::LearnDatum(const tf2_ros::Buffer& buffer) {
  try {
    const auto transform =
        buffer.lookupTransform("earth", config_.map_frame, ros::Time(0)).transform;
    if (map_ && earth_from_map_ == transform) return;
    map_.emplace(geo::DatumOf(Eigen::Isometry3d(tf2::transformToEigen(transform))));
    earth_from_map_ = transform;
    path_.poses.clear();
  } catch (const tf2::TransformException&) {
    // Whoever needs the map says that it is missing.
  } catch (const Error& error) {
    ROS_WARN_THROTTLE(kSayAgainS, "%s", error.what());
  }
}

void VehicleView::ShowFix(std::int64_t stamp_ns, const geo::TrackPose& antenna) {
  const bool fused = reporter_.config().position_source == vehicle::PositionSource::kFused;
  TellPosition(antenna, ros_io::ToRosTime(stamp_ns));
  if (!fused) ChooseMap(antenna.position);
  const auto at_stamp = reporter_.track().At(stamp_ns);
  if (!map_ || at_stamp.answer != vehicle::FixTrack::Answer::kReady) return;
  const Eigen::Vector2d antenna_m(config_.reporter.antenna_x_m, config_.reporter.antenna_y_m);
  const geo::GroundPoint origin{Eigen::Vector2d::Zero(), Eigen::Matrix2d::Zero()};
  geo::TrackPose base = at_stamp.pose;
  base.position = placement::PlaceHazard(base, antenna_m, origin).position;
  ShowVehicle(base, ros_io::ToRosTime(stamp_ns));
}

/// The map begins where the vehicle is, and again where it has never been able to drive to: where
/// it was first was wrong.
void VehicleView::ChooseMap(const geo::GeoPoint& antenna) {
  const bool keeps =
      map_ && (config_.map_datum || geo::GeodesicDistanceM(map_->datum(), antenna) <= kMaxRangeM);
  if (keeps) return;
  map_.emplace(antenna);
  path_.poses.clear();
}

void VehicleView::StartAnew() {
  path_.poses.clear();
  position_stamp_.reset();
}

void VehicleView::ShowPose(const geo::TrackPose& base, const ros::Time& stamp) {
  TellPosition(base, stamp);
  ShowVehicle(base, stamp);
}

void VehicleView::TellPosition(const geo::TrackPose& pose, const ros::Time& stamp) {
  const bool due = !position_stamp_ || stamp < *position_stamp_ ||
                   stamp - *position_stamp_ >= ros::Duration(config_.position_period_s);
  if (!due) return;
  position_stamp_ = stamp;
  zone::VehicleState vehicle{"",
                             config_.reporter.drive_id,
                             pose.position,
                             pose.course_rad,
                             pose.speed_mps,
                             ros_io::FromRosTime(stamp)};
  vehicle.outbox_age_s = reporter_.OutboxAgeS(vehicle.stamp_ns);
  const double sigma_m = std::sqrt(pose.covariance_m2.trace() / 2);
  const std::vector<std::string> configured_alone = {""};
  for (const std::string& zone : zones_.empty() ? configured_alone : zones_) {
    VehiclePosition position =
        ros_io::ToMessage(vehicle, sigma_m, reporter_.map().map_sequence(zone));
    position.zone = zone;
    position_publisher_.publish(position);
  }
}

/// base_link on the path, and on tf where no odometry does it.
void VehicleView::ShowVehicle(const geo::TrackPose& base, const ros::Time& stamp) {
  const Eigen::Vector2d base_m = map_->ToEnu(base.position);
  const auto pose = ros_io::VehiclePose(base_m, base.course_rad, config_.map_frame, stamp);
  if (config_.publish_tf) {
    geometry_msgs::TransformStamped transform;
    transform.header = pose.header;
    transform.child_frame_id = config_.base_frame;
    transform.transform.translation.x = base_m.x();
    transform.transform.translation.y = base_m.y();
    transform.transform.rotation = pose.pose.orientation;
    tf_broadcaster_.sendTransform(transform);
  }
  if (!path_.poses.empty()) {
    const auto& last = path_.poses.back().pose.position;
    if (std::hypot(base_m.x() - last.x, base_m.y() - last.y) < config_.path_spacing_m) return;
  }
  path_.header.stamp = stamp;
  path_.poses.push_back(pose);
  if (path_.poses.size() > static_cast<std::size_t>(config_.path_max_poses)) {
    path_.poses.erase(path_.poses.begin());
  }
}

void VehicleView::Publish() {
  if (path_publisher_.getNumSubscribers() > 0) path_publisher_.publish(path_);
  if (marker_publisher_.getNumSubscribers() == 0 || !map_) return;
  const auto known = reporter_.map().Known(static_cast<std::size_t>(config_.max_markers));
  marker_publisher_.publish(
      ros_io::HazardMarkers(known, catalogue_, *map_, config_.map_frame, ros::Time::now()));
}

}  // namespace livemap::nodelets
