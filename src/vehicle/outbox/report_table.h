#pragma once

#include <optional>

#include "common/sqlite.h"
#include "common/uuid.h"
#include "protocol/report.h"

namespace livemap::vehicle {

/// SQL of the table `pending`: one row per unfinished report, every field of Report but the
/// vehicle_id, which only the zone's bridge knows.
extern const char* const kCreateReportTable;
/// SQL that gives the table of an older LiveMap what a picture shows (the whole image) and until
/// when a report is held (it is not).
extern const char* const kAddShownRegionAndHold;
/// SQL that gives the table of an older LiveMap the zone of each report: empty, whichever it was.
extern const char* const kAddZoneOfReport;

/// `hold_until_ns`: UTC by the vehicle's clock; 0: the report may go at once.
void InsertReport(SqliteDatabase& database, const protocol::Report& report,
                  std::int64_t hold_until_ns);
/// Nothing when the table has no such report.
std::optional<protocol::Report> SelectReport(SqliteDatabase& database, const Uuid& uuid);

/// A row of the table.
struct StoredReport {
  protocol::Report report;
  bool sent = false;               ///< At least once.
  std::int64_t hold_until_ns = 0;  ///< As for InsertReport.
};
/// The same by the row's number, past every index: for a table whose indices are damaged.
std::optional<StoredReport> SelectReportOfRow(SqliteDatabase& database, std::int64_t row);

}  // namespace livemap::vehicle
