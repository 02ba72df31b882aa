#include "ros/conversions/map_change_conversions.h"

#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/message_fields.h"

namespace livemap::ros_io {

MapChange ToMessage(const protocol::MapChangeReport& report) {
  MapChange message;
  message.schema_version = MapChange::SCHEMA_VERSION;
  message.uuid = ToBytes(report.uuid);
  message.vehicle_id = report.vehicle_id;
  message.drive_id = report.drive_id;
  message.stamp = ToRosTime(report.stamp_ns);
  message.earlier_stamp = ToRosTime(report.earlier_stamp_ns);
  message.class_name = report.class_name;
  message.direction = report.vanished ? MapChange::VANISHED : MapChange::APPEARED;
  message.confidence = report.confidence;
  message.seen = report.seen;
  message.missed = report.missed;
  message.latitude = report.position.latitude_deg;
  message.longitude = report.position.longitude_deg;
  message.covariance = ToArray(report.covariance_m2);
  message.zone = report.zone;
  return message;
}

protocol::MapChangeReport FromMessage(const MapChange& message) {
  CheckVersion(message, "map change");
  if (message.direction != MapChange::APPEARED && message.direction != MapChange::VANISHED) {
    throw Error("map change has direction " + std::to_string(message.direction) +
                ", accepted is 1 (appeared) or 2 (vanished)");
  }
  protocol::MapChangeReport report;
  report.uuid = ToUuid(message.uuid);
  report.vehicle_id = message.vehicle_id;
  report.drive_id = message.drive_id;
  report.stamp_ns = FromRosTime(message.stamp);
  report.earlier_stamp_ns = FromRosTime(message.earlier_stamp);
  report.class_name = message.class_name;
  report.vanished = message.direction == MapChange::VANISHED;
  report.confidence = message.confidence;
  report.seen = message.seen;
  report.missed = message.missed;
  report.position = {message.latitude, message.longitude};
  report.covariance_m2 = ToMatrix(message.covariance);
  report.zone = message.zone;
  return report;
}

std::optional<protocol::MapChangeReport> ToMapChangeReport(const change::PlacedChange& change,
                                                           const std::string& drive_id,
                                                           const Uuid& uuid) {
  const change::ChangedObject& event = change.event;
  if (event.direction == change::ChangeDirection::kUnknown) return std::nullopt;
  protocol::MapChangeReport report;
  report.uuid = uuid;
  report.drive_id = drive_id;
  report.stamp_ns = event.last_ns;
  report.earlier_stamp_ns = event.earlier_ns;
  report.class_name = protocol::ChangeClassName(event.change_class);
  report.vanished = event.direction == change::ChangeDirection::kVanished;
  report.confidence = static_cast<float>(event.confidence);
  report.seen = static_cast<std::uint32_t>(event.seen);
  report.missed = static_cast<std::uint32_t>(event.missed);
  report.position = change.position;
  report.covariance_m2 = change.covariance_m2;
  return report;
}

}  // namespace livemap::ros_io
