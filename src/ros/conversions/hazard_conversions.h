#pragma once

#include <livemap/DetectionArray.h>
#include <livemap/HazardNotice.h>
#include <livemap/HazardReport.h>
#include <livemap/LinkState.h>
#include <livemap/ReportReceipt.h>
#include <livemap/VehiclePosition.h>
#include <ros/time.h>
#include <sensor_msgs/NavSatFix.h>

#include <cstdint>
#include <string>

#include "protocol/notice.h"
#include "protocol/report.h"
#include "vehicle/positioning/fix_track.h"
#include "vehicle/reporting/hazard_reporter.h"
#include "zone/model/hazard.h"
#include "zone/service/zone_service.h"

namespace livemap::ros_io {

// What crosses between the core and the messages of hazards, in both directions. FromMessage throws
// Error, with one sentence that says why, for a schema version or an enumeration value that this
// program does not know; ranges of values are the receiver's business. Stamps are UTC nanoseconds
// since 1970; those outside of what ros::Time holds (1970 to 2106) become its nearest end.

ros::Time ToRosTime(std::int64_t stamp_ns);
inline std::int64_t FromRosTime(const ros::Time& time) {
  return static_cast<std::int64_t>(time.toNSec());
}

HazardReport ToMessage(const protocol::Report& report);
protocol::Report FromMessage(const HazardReport& message);

ReportReceipt ToMessage(const protocol::Receipt& receipt);
protocol::Receipt FromMessage(const ReportReceipt& message);

/// To every vehicle: what drivers hear of the event. The notice's stamp is `hazard.updated_ns`, the
/// zone's clock at the event.
HazardNotice ToMessage(const zone::HazardEvent& event);
/// To one vehicle: the hazard as it is now, under the sequence of its last announcement.
HazardNotice ToVehicleMessage(const zone::Hazard& hazard, zone::HazardAction action,
                              const std::string& vehicle_id);
HazardNotice ToMessage(const protocol::Notice& notice);
protocol::Notice FromMessage(const HazardNotice& message);

/// `horizontal_sigma_m` per axis; the zone refuses a position without it. `map_sequence` up to
/// which the vehicle knows the zone's announcements.
VehiclePosition ToMessage(const zone::VehicleState& vehicle, double horizontal_sigma_m,
                          std::uint64_t map_sequence);
zone::VehicleState FromMessage(const VehiclePosition& message);

vehicle::LinkCost FromMessage(const LinkState& message);

placement::SightingFrame ToSightingFrame(const DetectionArray& message);
geo::Fix ToFix(const sensor_msgs::NavSatFix& message);

}  // namespace livemap::ros_io
