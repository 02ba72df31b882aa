#pragma once

#include <cmath>
#include <cstdint>
#include <string>

#include "common/sqlite.h"
#include "protocol/notice.h"
#include "protocol/report.h"

namespace livemap::vehicle {

// Reports and notices of hazards along a street, told apart by a number: for tests.

constexpr geo::GeoPoint kStreet{40.4433, -79.9436};
constexpr std::int64_t kNowNs = 1'700'000'000'000'000'000;

inline geo::GeoPoint East(double distance_m) {
  return geo::GeodesicDestination(kStreet, M_PI / 2, distance_m);
}

inline Uuid Id(int number) {
  Uuid id;
  id.bytes[0] = 1;
  id.bytes[14] = static_cast<std::uint8_t>(number / 256);
  id.bytes[15] = static_cast<std::uint8_t>(number % 256);
  return id;
}

inline protocol::Report MakeReport(int number, const geo::GeoPoint& position,
                                   const std::string& name = "pothole") {
  protocol::Report report;
  report.uuid = Id(number);
  report.drive_id = "drive-1";
  report.stamp_ns = kNowNs + number;
  report.class_name = name;
  report.confidence = 0.75F;
  report.box = {1, 2, 30, 40};
  report.position = position;
  report.covariance_m2 << 2.0, 0.25, 0.25, 1.5;
  report.image_width = 640;
  report.image_height = 400;
  report.image_frame_id = "camera_optical_frame";
  report.image_format = "jpeg";
  report.image = {0xff, 0xd8, 0x00, 0x01};
  return report;
}

inline protocol::Notice MakeNotice(protocol::Notice::Action action, int hazard,
                                   const geo::GeoPoint& position, std::uint64_t sequence) {
  protocol::Notice notice;
  notice.action = action;
  notice.sequence = sequence;
  notice.hazard_uuid = Id(hazard);
  notice.stamp_ns = kNowNs + static_cast<std::int64_t>(sequence);
  notice.class_name = "pothole";
  notice.confidence = 0.5F;
  notice.position = position;
  return notice;
}

/// Gives an outbox the shape that it had before pictures showed a part of the image, reports were
/// held, and there were several zones and cells of the map.
inline void MakeOlder(const std::string& path) {
  SqliteDatabase database(path, /*durable=*/true);
  for (const char* column :
       {"shown_x", "shown_y", "shown_width", "shown_height", "hold_until_ns"}) {
    database.Execute(std::string("ALTER TABLE pending DROP COLUMN ") + column);
  }
  database.Execute(
      "ALTER TABLE pending DROP COLUMN zone; ALTER TABLE known DROP COLUMN zone;"
      "ALTER TABLE known DROP COLUMN course_rad; ALTER TABLE known DROP COLUMN trails;"
      "CREATE TABLE zone(map_sequence INTEGER NOT NULL);"
      "INSERT INTO zone SELECT coalesce(max(map_sequence), 0) FROM zones; DROP TABLE zones;"
      "DROP TABLE cells;"
      "ALTER TABLE gone RENAME TO gone_of_zones;"
      "CREATE TABLE gone(id BLOB PRIMARY KEY, sequence INTEGER NOT NULL) WITHOUT ROWID;"
      "INSERT INTO gone SELECT id,sequence FROM gone_of_zones; DROP TABLE gone_of_zones;"
      "CREATE INDEX gone_by_sequence ON gone(sequence);"
      "PRAGMA user_version=2");
}

}  // namespace livemap::vehicle
