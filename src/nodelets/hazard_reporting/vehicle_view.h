#pragma once

#include <geometry_msgs/Transform.h>
#include <nav_msgs/Path.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "geo/datum.h"
#include "ros/parameters/hazard_reporting_parameters.h"
#include "vehicle/reporting/hazard_reporter.h"

namespace livemap::nodelets {

/// Tells and shows where the vehicle is and what it knows: vehicle/position, path, tf and
/// hazard/local_map. Not thread-safe.
class VehicleView {
 public:
  /// Advertises its topics. `config`, `reporter` and `catalogue` outlive it.
  VehicleView(const ros_io::HazardReportingConfig& config, const vehicle::HazardReporter& reporter,
              const protocol::HazardCatalogue& catalogue, ros::NodeHandle& node);

  /// The datum of the map frame is that of its owner, the localisation: tf earth -> map.
  void LearnDatum(const tf2_ros::Buffer& buffer);
  /// The map frame's place on earth, once it is known.
  const std::optional<geo::LocalFrame>& map() const { return map_; }

  /// Ids of the zones that are told each position, each with what the vehicle knows of it. None:
  /// the configured zone is.
  void SetZones(std::vector<std::string> zones) { zones_ = std::move(zones); }
  /// Where the fix of this stamp is: `antenna`.
  void ShowFix(std::int64_t stamp_ns, const geo::TrackPose& antenna);
  /// Where base_link is by a fused pose; the map is known.
  void ShowPose(const geo::TrackPose& base, const ros::Time& stamp);
  /// Time went back: the path begins anew, the map stays.
  void StartAnew();
  /// Path and markers, where somebody looks at them.
  void Publish();

 private:
  void ChooseMap(const geo::GeoPoint& antenna);
  void TellPosition(const geo::TrackPose& pose, const ros::Time& stamp);
  void ShowVehicle(const geo::TrackPose& base, const ros::Time& stamp);

  const ros_io::HazardReportingConfig& config_;
  const vehicle::HazardReporter& reporter_;
  const protocol::HazardCatalogue& catalogue_;
  std::optional<geo::LocalFrame> map_;
  geometry_msgs::Transform earth_from_map_;  // By which map_ was made, if it was.
  std::optional<ros::Time> position_stamp_;
  std::vector<std::string> zones_;
  nav_msgs::Path path_;
  tf2_ros::TransformBroadcaster tf_broadcaster_;
  ros::Publisher position_publisher_, marker_publisher_, path_publisher_;
};

}  // namespace livemap::nodelets
