#include "ros/conversions/hazard_conversions.h"

#include <algorithm>
#include <limits>

#include "common/error.h"
#include "ros/conversions/message_fields.h"
#include "ros/conversions/trail_conversions.h"

namespace livemap::ros_io {

ros::Time ToRosTime(std::int64_t stamp_ns) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  constexpr std::int64_t kLatest = std::numeric_limits<std::uint32_t>::max() * kSecond;
  const std::int64_t clamped = std::clamp<std::int64_t>(stamp_ns, 0, kLatest);
  return {static_cast<std::uint32_t>(clamped / kSecond),
          static_cast<std::uint32_t>(clamped % kSecond)};
}

HazardReport ToMessage(const protocol::Report& report) {
  HazardReport message;
  message.schema_version = HazardReport::SCHEMA_VERSION;
  message.uuid = ToBytes(report.uuid);
  message.vehicle_id = report.vehicle_id;
  message.drive_id = report.drive_id;
  message.stamp = ToRosTime(report.stamp_ns);
  message.class_name = report.class_name;
  message.confidence = report.confidence;
  message.x_min = report.box.x_min;
  message.y_min = report.box.y_min;
  message.x_max = report.box.x_max;
  message.y_max = report.box.y_max;
  message.latitude = report.position.latitude_deg;
  message.longitude = report.position.longitude_deg;
  message.covariance = ToArray(report.covariance_m2);
  message.image_width = report.image_width;
  message.image_height = report.image_height;
  message.image.header.stamp = message.stamp;
  message.image.header.frame_id = report.image_frame_id;
  message.image.format = report.image_format;
  message.image.data = report.image;
  message.shown_x = report.shown.x;
  message.shown_y = report.shown.y;
  message.shown_width = report.shown.width;
  message.shown_height = report.shown.height;
  message.zone = report.zone;
  return message;
}

protocol::Report FromMessage(const HazardReport& message) {
  constexpr std::uint16_t kWholeImages = 1;  // Has no region: its pictures show the whole image.
  CheckVersion(message, "hazard report", kWholeImages);
  protocol::Report report;
  report.uuid = ToUuid(message.uuid);
  report.vehicle_id = message.vehicle_id;
  report.drive_id = message.drive_id;
  report.stamp_ns = FromRosTime(message.stamp);
  report.class_name = message.class_name;
  report.confidence = message.confidence;
  report.box = {message.x_min, message.y_min, message.x_max, message.y_max};
  report.position = {message.latitude, message.longitude};
  report.covariance_m2 = ToMatrix(message.covariance);
  report.image_width = message.image_width;
  report.image_height = message.image_height;
  report.image_frame_id = message.image.header.frame_id;
  report.image_format = message.image.format;
  report.image = message.image.data;
  report.zone = message.zone;
  if (message.schema_version != kWholeImages) {
    report.shown = {message.shown_x, message.shown_y, message.shown_width, message.shown_height};
  }
  return report;
}

ReportReceipt ToMessage(const protocol::Receipt& receipt) {
  ReportReceipt message;
  message.schema_version = ReportReceipt::SCHEMA_VERSION;
  message.status = receipt.status == protocol::Receipt::Status::kCommitted
                       ? ReportReceipt::COMMITTED
                       : ReportReceipt::REFUSED;
  message.report_uuid = ToBytes(receipt.report_uuid);
  message.hazard_uuid = ToBytes(receipt.hazard_uuid);
  message.vehicle_id = receipt.vehicle_id;
  message.reason = receipt.reason;
  message.zone = receipt.zone;
  return message;
}

protocol::Receipt FromMessage(const ReportReceipt& message) {
  CheckVersion(message, "report receipt");
  protocol::Receipt receipt;
  switch (message.status) {
    case ReportReceipt::COMMITTED:
      receipt.status = protocol::Receipt::Status::kCommitted;
      break;
    case ReportReceipt::REFUSED:
      receipt.status = protocol::Receipt::Status::kRefused;
      break;
    default:
      throw Error("report receipt has status " + std::to_string(message.status) +
                  ", accepted is 0 (committed) or 1 (refused)");
  }
  receipt.report_uuid = ToUuid(message.report_uuid);
  receipt.hazard_uuid = ToUuid(message.hazard_uuid);
  receipt.vehicle_id = message.vehicle_id;
  receipt.reason = message.reason;
  receipt.zone = message.zone;
  return receipt;
}

namespace {

protocol::Notice::Action ToNoticeAction(zone::HazardAction action) {
  switch (action) {
    case zone::HazardAction::kAdded:
      return protocol::Notice::Action::kAdded;
    case zone::HazardAction::kUpdated:
      return protocol::Notice::Action::kUpdated;
    case zone::HazardAction::kRemoved:
      return protocol::Notice::Action::kRemoved;
  }
  return protocol::Notice::Action::kRemoved;
}

protocol::Notice NoticeOf(const zone::Hazard& hazard) {
  protocol::Notice notice;
  notice.hazard_uuid = hazard.uuid;
  notice.stamp_ns = hazard.updated_ns;
  notice.class_name = hazard.class_name;
  notice.confidence = hazard.confidence;
  notice.position = hazard.position;
  notice.covariance_m2 = hazard.covariance_m2;
  notice.sightings = hazard.sightings;
  notice.first_seen_ns = hazard.first_seen_ns;
  notice.last_seen_ns = hazard.last_seen_ns;
  notice.course_rad = hazard.course_rad;
  notice.trails = hazard.trails;
  return notice;
}

}  // namespace

HazardNotice ToMessage(const zone::HazardEvent& event) {
  protocol::Notice notice = NoticeOf(event.hazard);
  // What drivers knew before decides: a candidate that becomes active is new to them.
  notice.action =
      ToNoticeAction(zone::DriversAction(event.from, event.hazard.state).value_or(event.action));
  notice.sequence = event.hazard.sequence;
  notice.previous_sequence = event.previous_announced;
  return ToMessage(notice);
}

HazardNotice ToVehicleMessage(const zone::Hazard& hazard, zone::HazardAction action,
                              const std::string& vehicle_id) {
  protocol::Notice notice = NoticeOf(hazard);
  notice.action = ToNoticeAction(action);
  notice.sequence = hazard.announced_sequence;
  notice.vehicle_id = vehicle_id;
  return ToMessage(notice);
}

HazardNotice ToMessage(const protocol::Notice& notice) {
  HazardNotice message;
  message.schema_version = HazardNotice::SCHEMA_VERSION;
  switch (notice.action) {
    case protocol::Notice::Action::kAdded:
      message.action = HazardNotice::ADDED;
      break;
    case protocol::Notice::Action::kUpdated:
      message.action = HazardNotice::UPDATED;
      break;
    case protocol::Notice::Action::kRemoved:
      message.action = HazardNotice::REMOVED;
      break;
    case protocol::Notice::Action::kCaughtUp:
      message.action = HazardNotice::CAUGHT_UP;
      break;
  }
  message.sequence = notice.sequence;
  message.previous_sequence = notice.previous_sequence;
  message.vehicle_id = notice.vehicle_id;
  message.hazard_uuid = ToBytes(notice.hazard_uuid);
  message.stamp = ToRosTime(notice.stamp_ns);
  message.class_name = notice.class_name;
  message.confidence = notice.confidence;
  message.latitude = notice.position.latitude_deg;
  message.longitude = notice.position.longitude_deg;
  message.covariance = ToArray(notice.covariance_m2);
  message.sightings = notice.sightings;
  message.first_seen = ToRosTime(notice.first_seen_ns);
  message.last_seen = ToRosTime(notice.last_seen_ns);
  message.radius = static_cast<float>(notice.radius_m);
  message.told = notice.told;
  message.image.header.stamp = message.last_seen;
  message.image.format = notice.image_format;
  message.image.data = notice.image;
  message.course = static_cast<float>(notice.course_rad);
  AppendTrails(notice.trails, notice.position, 0, message.trails);
  message.zone = notice.zone;
  return message;
}

protocol::Notice FromMessage(const HazardNotice& message) {
  constexpr std::uint16_t kWithoutCourse = 2;
  CheckVersion(message, "hazard notice", kWithoutCourse);
  protocol::Notice notice;
  switch (message.action) {
    case HazardNotice::ADDED:
      notice.action = protocol::Notice::Action::kAdded;
      break;
    case HazardNotice::UPDATED:
      notice.action = protocol::Notice::Action::kUpdated;
      break;
    case HazardNotice::REMOVED:
      notice.action = protocol::Notice::Action::kRemoved;
      break;
    case HazardNotice::CAUGHT_UP:
      notice.action = protocol::Notice::Action::kCaughtUp;
      break;
    default:
      throw Error("hazard notice has action " + std::to_string(message.action) +
                  ", accepted is 0 (added), 1 (updated), 2 (removed) or 3 (caught up)");
  }
  notice.sequence = message.sequence;
  notice.previous_sequence = message.previous_sequence;
  notice.vehicle_id = message.vehicle_id;
  notice.hazard_uuid = ToUuid(message.hazard_uuid);
  notice.stamp_ns = FromRosTime(message.stamp);
  notice.class_name = message.class_name;
  notice.confidence = message.confidence;
  notice.position = {message.latitude, message.longitude};
  notice.covariance_m2 = ToMatrix(message.covariance);
  notice.sightings = message.sightings;
  notice.first_seen_ns = FromRosTime(message.first_seen);
  notice.last_seen_ns = FromRosTime(message.last_seen);
  notice.radius_m = static_cast<double>(message.radius);
  notice.told = message.told;
  notice.image_format = message.image.format;
  notice.image = message.image.data;
  if (message.schema_version > kWithoutCourse) {
    notice.course_rad = static_cast<double>(message.course);
  }
  for (const HazardTrail& trail : message.trails) {
    TakeTrail(trail, notice.position, "hazard notice", notice.trails);
  }
  notice.zone = message.zone;
  return notice;
}

VehiclePosition ToMessage(const zone::VehicleState& vehicle, double horizontal_sigma_m,
                          std::uint64_t map_sequence) {
  VehiclePosition message;
  message.schema_version = VehiclePosition::SCHEMA_VERSION;
  message.vehicle_id = vehicle.vehicle_id;
  message.drive_id = vehicle.drive_id;
  message.stamp = ToRosTime(vehicle.stamp_ns);
  message.latitude = vehicle.position.latitude_deg;
  message.longitude = vehicle.position.longitude_deg;
  message.course = static_cast<float>(vehicle.course_rad);
  message.speed = static_cast<float>(vehicle.speed_mps);
  message.horizontal_sigma = static_cast<float>(horizontal_sigma_m);
  message.map_sequence = map_sequence;
  message.outbox_age = static_cast<float>(vehicle.outbox_age_s.value_or(0));
  return message;
}

zone::VehicleState FromMessage(const VehiclePosition& message) {
  constexpr std::uint16_t kWithoutOutbox = 2;  // Does not say how old its outbox is.
  CheckVersion(message, "vehicle position", kWithoutOutbox);
  zone::VehicleState vehicle;
  vehicle.vehicle_id = message.vehicle_id;
  vehicle.drive_id = message.drive_id;
  vehicle.position = {message.latitude, message.longitude};
  vehicle.course_rad = static_cast<double>(message.course);
  vehicle.speed_mps = static_cast<double>(message.speed);
  vehicle.stamp_ns = FromRosTime(message.stamp);
  vehicle.sigma_m = static_cast<double>(message.horizontal_sigma);
  if (message.schema_version > kWithoutOutbox) {
    vehicle.outbox_age_s = static_cast<double>(message.outbox_age);
  }
  return vehicle;
}

vehicle::LinkCost FromMessage(const LinkState& message) {
  switch (message.state) {
    case LinkState::UNKNOWN:
      return vehicle::LinkCost::kUnknown;
    case LinkState::CHEAP:
      return vehicle::LinkCost::kCheap;
    case LinkState::METERED:
      return vehicle::LinkCost::kMetered;
    case LinkState::NONE:
      return vehicle::LinkCost::kNone;
    default:
      throw Error("link state is " + std::to_string(message.state) +
                  ", accepted is 0 (unknown), 1 (cheap), 2 (metered) or 3 (none)");
  }
}

placement::SightingFrame ToSightingFrame(const DetectionArray& message) {
  placement::SightingFrame frame;
  frame.stamp_ns = FromRosTime(message.header.stamp);
  frame.frame_id = message.header.frame_id;
  frame.image_width = message.image_width;
  frame.image_height = message.image_height;
  for (const auto& detection : message.detections) {
    frame.sightings.push_back(
        {detection.class_name,
         detection.confidence,
         {detection.x_min, detection.y_min, detection.x_max, detection.y_max}});
  }
  return frame;
}

geo::Fix ToFix(const sensor_msgs::NavSatFix& message) {
  geo::Fix fix;
  fix.stamp_ns = FromRosTime(message.header.stamp);
  fix.has_fix = message.status.status >= sensor_msgs::NavSatStatus::STATUS_FIX;
  fix.position = {message.latitude, message.longitude};
  if (message.position_covariance_type != sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN) {
    // East-north part of the row-major 3x3 east-north-up covariance.
    Eigen::Matrix2d covariance_m2;
    covariance_m2 << message.position_covariance[0], message.position_covariance[1],
        message.position_covariance[3], message.position_covariance[4];
    fix.covariance_m2 = covariance_m2;
  }
  return fix;
}

}  // namespace livemap::ros_io
