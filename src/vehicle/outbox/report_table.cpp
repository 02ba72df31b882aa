#include "vehicle/outbox/report_table.h"

#include <string>

#include "vehicle/outbox/pending_table.h"

namespace livemap::vehicle {
namespace {

constexpr char kSelectReport[] =
    "SELECT drive_id,stamp_ns,class_name,confidence,x_min,y_min,x_max,y_max,latitude,longitude,"
    "variance_east,covariance_east_north,variance_north,"
    "image_width,image_height,image_frame_id,image_format,image,uuid,sent,"
    "shown_x,shown_y,shown_width,shown_height,hold_until_ns,zone FROM pending ";

/// Of a row of kSelectReport.
protocol::Report ReadStoredReport(const SqliteStatement& row) {
  const auto real = [&row](int column) { return static_cast<float>(row.Real(column)); };
  protocol::Report report;
  report.drive_id = row.Text(0);
  report.stamp_ns = row.Int(1);
  report.class_name = row.Text(2);
  report.confidence = real(3);
  report.box = {real(4), real(5), real(6), real(7)};
  report.position = {row.Real(8), row.Real(9)};
  report.covariance_m2 << row.Real(10), row.Real(11), row.Real(11), row.Real(12);
  report.image_width = static_cast<std::uint32_t>(row.Int(13));
  report.image_height = static_cast<std::uint32_t>(row.Int(14));
  report.image_frame_id = row.Text(15);
  report.image_format = row.Text(16);
  report.image = row.Blob(17);
  report.uuid = UuidFromBlob(row.Blob(18));
  const auto pixels = [&row](int column) { return static_cast<std::uint32_t>(row.Int(column)); };
  report.shown = {pixels(20), pixels(21), pixels(22), pixels(23)};
  report.zone = row.Text(25);
  return report;
}

}  // namespace

const char* const kCreateReportTable =
    "CREATE TABLE pending("
    "  uuid BLOB PRIMARY KEY,"
    "  sent INTEGER NOT NULL DEFAULT 0,"
    "  drive_id TEXT NOT NULL,"
    "  stamp_ns INTEGER NOT NULL,"
    "  class_name TEXT NOT NULL,"
    "  confidence REAL NOT NULL,"
    "  x_min REAL NOT NULL, y_min REAL NOT NULL, x_max REAL NOT NULL, y_max REAL NOT NULL,"
    "  latitude REAL NOT NULL, longitude REAL NOT NULL,"
    "  variance_east REAL NOT NULL, covariance_east_north REAL NOT NULL,"
    "  variance_north REAL NOT NULL,"
    "  image_width INTEGER NOT NULL, image_height INTEGER NOT NULL,"
    "  image_frame_id TEXT NOT NULL, image_format TEXT NOT NULL,"
    "  image BLOB NOT NULL);";

const char* const kAddShownRegionAndHold =
    "ALTER TABLE pending ADD COLUMN shown_x INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE pending ADD COLUMN shown_y INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE pending ADD COLUMN shown_width INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE pending ADD COLUMN shown_height INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE pending ADD COLUMN hold_until_ns INTEGER NOT NULL DEFAULT 0;";

const char* const kAddZoneOfReport =
    "ALTER TABLE pending ADD COLUMN zone TEXT NOT NULL DEFAULT '';";

void InsertReport(SqliteDatabase& database, const protocol::Report& report,
                  std::int64_t hold_until_ns) {
  SqliteStatement insert = database.Prepare(
      "INSERT INTO pending(uuid,drive_id,stamp_ns,class_name,confidence,x_min,y_min,x_max,y_max,"
      "latitude,longitude,variance_east,covariance_east_north,variance_north,"
      "image_width,image_height,image_frame_id,image_format,image,"
      "shown_x,shown_y,shown_width,shown_height,hold_until_ns,zone)"
      " VALUES(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)");
  insert.BindBlob(1, report.uuid.bytes.data(), report.uuid.bytes.size())
      .Bind(2, report.drive_id)
      .Bind(3, report.stamp_ns)
      .Bind(4, report.class_name)
      .Bind(5, static_cast<double>(report.confidence))
      .Bind(6, static_cast<double>(report.box.x_min))
      .Bind(7, static_cast<double>(report.box.y_min))
      .Bind(8, static_cast<double>(report.box.x_max))
      .Bind(9, static_cast<double>(report.box.y_max))
      .Bind(10, report.position.latitude_deg)
      .Bind(11, report.position.longitude_deg)
      .Bind(12, report.covariance_m2(0, 0))
      .Bind(13, report.covariance_m2(0, 1))
      .Bind(14, report.covariance_m2(1, 1))
      .Bind(15, static_cast<std::int64_t>(report.image_width))
      .Bind(16, static_cast<std::int64_t>(report.image_height))
      .Bind(17, report.image_frame_id)
      .Bind(18, report.image_format)
      .BindBlob(19, report.image.data(), report.image.size())
      .Bind(20, static_cast<std::int64_t>(report.shown.x))
      .Bind(21, static_cast<std::int64_t>(report.shown.y))
      .Bind(22, static_cast<std::int64_t>(report.shown.width))
      .Bind(23, static_cast<std::int64_t>(report.shown.height))
      .Bind(24, hold_until_ns)
      .Bind(25, report.zone)
      .Execute();
}

std::optional<protocol::Report> SelectReport(SqliteDatabase& database, const Uuid& uuid) {
  SqliteStatement row = database.Prepare(std::string(kSelectReport) + "WHERE uuid=?");
  row.BindBlob(1, uuid.bytes.data(), uuid.bytes.size());
  if (!row.Step()) return std::nullopt;
  return ReadStoredReport(row);
}

std::optional<StoredReport> SelectReportOfRow(SqliteDatabase& database, std::int64_t row_number) {
  SqliteStatement row = database.Prepare(std::string(kSelectReport) + "NOT INDEXED WHERE rowid=?");
  row.Bind(1, row_number);
  if (!row.Step()) return std::nullopt;
  return StoredReport{ReadStoredReport(row), row.Int(19) != 0, row.Int(24)};
}

}  // namespace livemap::vehicle
