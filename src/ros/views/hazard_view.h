#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/time.h>
#include <visualization_msgs/MarkerArray.h>

#include <string>
#include <vector>

#include "geo/wgs84.h"
#include "protocol/hazard_catalogue.h"
#include "vehicle/polls/poll_responder.h"
#include "vehicle/reporting/hazard_reporter.h"
#include "vehicle/reporting/local_hazard_map.h"

namespace livemap::ros_io {

/// The known hazards for rviz: a cylinder in the class's colour, pale while only this vehicle knows
/// it, and its label above. Replaces what was shown before.
visualization_msgs::MarkerArray HazardMarkers(const std::vector<vehicle::KnownHazard>& hazards,
                                              const protocol::HazardCatalogue& catalogue,
                                              const geo::LocalFrame& map,
                                              const std::string& map_frame, const ros::Time& stamp);

/// Pose of base_link in the map frame (x east, y north, z up). `course_rad` clockwise from north.
geometry_msgs::PoseStamped VehiclePose(const Eigen::Vector2d& east_north_m, double course_rad,
                                       const std::string& map_frame, const ros::Time& stamp);

/// Fused poses are wanted, and have not come for two seconds while fixes did.
bool IsFusionSilent(const vehicle::HazardReporter& reporter);

/// What hazard_reporting did since its start, each counter under its own name; a warning while it
/// lacks fixes or camera, an error while its store fails.
void DescribeHazardReporter(const vehicle::HazardReporter& reporter, double steady_s,
                            diagnostic_updater::DiagnosticStatusWrapper& status);

/// What became of the zone's polls, the same way; to be called after DescribeHazardReporter.
void DescribePollResponder(const vehicle::PollResponder& responder,
                           diagnostic_updater::DiagnosticStatusWrapper& status);

/// The sentence about rows of a sound store of `path` that hold impossible values.
std::string DescribeBrokenRows(const std::string& path, const vehicle::LocalHazardMap& map);
/// The sentence about a corrupt store of `path` that was moved away: where to, and what of its
/// unfinished reports came back.
std::string DescribeSetAside(const std::string& path, const vehicle::LocalHazardMap& map);

}  // namespace livemap::ros_io
