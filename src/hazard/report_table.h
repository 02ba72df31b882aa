#pragma once

#include <optional>

#include "base/sqlite.h"
#include "base/uuid.h"
#include "hazard/report.h"

namespace livemap {

/// SQL of the table `pending`: one row per unfinished report, every field of Report but the
/// vehicle_id, which only the zone's bridge knows.
extern const char* const kCreateReportTable;

void InsertReport(SqliteDatabase& database, const Report& report);
/// Nothing when the table has no such report.
std::optional<Report> SelectReport(SqliteDatabase& database, const Uuid& uuid);

/// A row of the table.
struct StoredReport {
  Report report;
  bool sent = false;  ///< At least once.
};
/// The same by the row's number, past every index: for a table whose indices are damaged.
std::optional<StoredReport> SelectReportOfRow(SqliteDatabase& database, std::int64_t row);

/// The nil UUID when the blob has not 16 bytes.
Uuid UuidFromBlob(const std::vector<std::uint8_t>& blob);

}  // namespace livemap
