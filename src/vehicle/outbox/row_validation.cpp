#include "vehicle/outbox/row_validation.h"

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "common/time.h"
#include "imaging/image_header.h"
#include "vehicle/outbox/pending_table.h"
#include "vehicle/outbox/report_table.h"

namespace livemap::vehicle {
namespace {

// The zone's numbers of its announcements lie far below 2^60, and stamps below 2106.
constexpr char kBrokenKnown[] =
    "NOT (typeof(id) = 'blob' AND length(id) = 16 AND id <> zeroblob(16) AND "
    "typeof(of_zone) = 'integer' AND of_zone IN (0, 1) AND "
    "typeof(class_name) IN ('text', 'blob') AND "
    "length(CAST(class_name AS BLOB)) BETWEEN 1 AND 64 AND "
    "typeof(confidence) IN ('real', 'integer') AND confidence BETWEEN 0 AND 1 AND "
    "typeof(latitude) IN ('real', 'integer') AND latitude BETWEEN -90 AND 90 AND "
    "typeof(longitude) IN ('real', 'integer') AND longitude BETWEEN -180 AND 180 AND "
    "typeof(sequence) = 'integer' AND sequence BETWEEN 0 AND 1152921504606846975 AND "
    "typeof(news_ns) = 'integer' AND news_ns BETWEEN 0 AND 4294967294999999999 AND "
    "(course_rad IS NULL OR (typeof(course_rad) = 'real' AND abs(course_rad) < 6.2831854)) AND "
    "(trails IS NULL OR (typeof(trails) = 'text' AND length(CAST(trails AS BLOB)) <= 1024)))";
constexpr char kBrokenGone[] =
    "NOT (typeof(id) = 'blob' AND length(id) = 16 AND typeof(sequence) = 'integer' AND "
    "sequence BETWEEN 0 AND 1152921504606846975)";
constexpr char kBrokenZone[] =
    "NOT (typeof(map_sequence) = 'integer' AND "
    "map_sequence BETWEEN 0 AND 1152921504606846975)";

constexpr char kBrokenCell[] =
    "NOT (typeof(cell) = 'integer' AND cell BETWEEN 0 AND 1073741823 AND "
    "typeof(sequence) = 'integer' AND sequence BETWEEN 0 AND 1152921504606846975)";

std::string BrokenOr(const std::string& broken, const std::string& valid) {
  return broken + " OR NOT (" + valid + ")";
}

std::size_t CountInvalidRows(SqliteDatabase& database, const std::string& table,
                             const std::string& which) {
  SqliteStatement query = database.Prepare("SELECT count(*) FROM " + table + " WHERE " + which);
  query.Step();
  return static_cast<std::size_t>(query.Int(0));
}

std::size_t TakeOutInvalidRows(SqliteDatabase& database, const std::string& table,
                               const std::string& which) {
  const std::size_t count = CountInvalidRows(database, table, which);
  if (count > 0) database.Execute("DELETE FROM " + table + " WHERE " + which);
  return count;
}

}  // namespace

bool IsCovarianceOfReport(const Eigen::Matrix2d& covariance_m2) {
  constexpr double kMaxVarianceM2 = 1e8;
  return covariance_m2.allFinite() && covariance_m2(0, 0) > 0 && covariance_m2(1, 1) > 0 &&
         covariance_m2.cwiseAbs().maxCoeff() <= kMaxVarianceM2 && covariance_m2.determinant() > 0;
}

const char* const kZoneColumnIsValid =
    "typeof(zone) = 'text' AND length(CAST(zone AS BLOB)) <= 64 AND "
    "zone NOT GLOB '*[^A-Za-z0-9._-]*'";

const char* const kFetchableReport =
    "typeof(uuid) = 'blob' AND length(uuid) = 16 AND uuid <> zeroblob(16) AND "
    "length(CAST(drive_id AS BLOB)) <= 64 AND length(CAST(class_name AS BLOB)) <= 64 AND "
    "length(CAST(image_frame_id AS BLOB)) <= 256 AND length(CAST(image_format AS BLOB)) <= 64 AND "
    "length(CAST(image AS BLOB)) <= 16777216 AND typeof(stamp_ns) = 'integer' AND "
    "typeof(confidence) IN ('real', 'integer') AND typeof(latitude) IN ('real', 'integer') AND "
    "typeof(longitude) IN ('real', 'integer') AND typeof(x_min) IN ('real', 'integer') AND "
    "typeof(y_min) IN ('real', 'integer') AND typeof(x_max) IN ('real', 'integer') AND "
    "typeof(y_max) IN ('real', 'integer') AND typeof(variance_east) IN ('real', 'integer') AND "
    "typeof(covariance_east_north) IN ('real', 'integer') AND "
    "typeof(variance_north) IN ('real', 'integer') AND "
    "image_width BETWEEN 0 AND 4294967295 AND image_height BETWEEN 0 AND 4294967295 AND "
    "shown_x BETWEEN 0 AND 4294967295 AND shown_y BETWEEN 0 AND 4294967295 AND "
    "shown_width BETWEEN 0 AND 4294967295 AND shown_height BETWEEN 0 AND 4294967295 AND "
    "typeof(hold_until_ns) = 'integer' AND "
    "typeof(zone) = 'text' AND length(CAST(zone AS BLOB)) <= 64 AND "
    "zone NOT GLOB '*[^A-Za-z0-9._-]*'";

bool IsSound(const protocol::Report& report) {
  const imaging::Box& box = report.box;
  return !report.uuid.IsNil() && geo::IsValid(report.position) && IsStamp(report.stamp_ns) &&
         IsCovarianceOfReport(report.covariance_m2) && report.confidence >= 0 &&
         report.confidence <= 1 && std::isfinite(box.x_min) && std::isfinite(box.y_min) &&
         std::isfinite(box.x_max) && std::isfinite(box.y_max) && box.x_min < box.x_max &&
         box.y_min < box.y_max && !report.class_name.empty() &&
         report.class_name.size() <= protocol::kMaxClassNameBytes &&
         report.drive_id.size() <= kMaxIdBytes;
}

void DropInvalidPicture(protocol::Report& report) {
  const std::uint8_t* data = report.image.data();
  const auto header = imaging::ReadImageHeader(data, report.image.size());
  if (header && imaging::HasImageEnd(data, report.image.size(), header->format)) return;
  report.image.clear();
  report.image_format.clear();
}

InvalidRows RepairTables(SqliteDatabase& database) {
  InvalidRows broken;
  database.Transaction([&] {
    // Of a zone that is taken out the vehicle knows nothing: so it is told everything.
    broken.known =
        TakeOutInvalidRows(database, "known", BrokenOr(kBrokenKnown, kZoneColumnIsValid)) +
        TakeOutInvalidRows(database, "gone", BrokenOr(kBrokenGone, kZoneColumnIsValid)) +
        TakeOutInvalidRows(database, "zones", BrokenOr(kBrokenZone, kZoneColumnIsValid)) +
        TakeOutInvalidRows(database, "cells", BrokenOr(kBrokenCell, kZoneColumnIsValid));
    // Nor does the vehicle know a cell of which something is taken out.
    if (broken.known > 0) database.Execute("DELETE FROM cells");
  });
  broken.reports =
      CountInvalidRows(database, "pending", std::string("NOT (") + kFetchableReport + ")");
  std::vector<Uuid> uuids;
  SqliteStatement rows =
      database.Prepare(std::string("SELECT uuid FROM pending WHERE ") + kFetchableReport);
  while (rows.Step()) uuids.push_back(UuidFromBlob(rows.Blob(0)));
  for (const Uuid& uuid : uuids) {
    const auto report = SelectReport(database, uuid);
    if (report && IsSound(*report)) continue;
    broken.unsendable.insert(uuid);
    ++broken.reports;
  }
  return broken;
}

}  // namespace livemap::vehicle
