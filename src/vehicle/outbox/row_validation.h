#pragma once

#include <cstddef>
#include <set>

#include "common/sqlite.h"
#include "common/uuid.h"
#include "protocol/report.h"

namespace livemap::vehicle {

/// Pictures of reports in the outbox may be this large; a larger one was not made by this program.
constexpr std::size_t kMaxStoredImageBytes = 16 << 20;
/// And a drive's id this long.
constexpr std::size_t kMaxIdBytes = 64;

/// Whether it can be that of a reported position: finite, positive definite, below 1e8 m^2.
bool IsCovarianceOfReport(const Eigen::Matrix2d& covariance_m2);

/// Whether the program can have made this report. What a damaged page turned into, or something
/// else wrote, must not become one: the zone would refuse it, or never answer.
bool IsSound(const protocol::Report& report);
/// A report counts without its picture; a broken picture would have it refused for good.
void DropInvalidPicture(protocol::Report& report);

/// What was found in a sound store that the program cannot have written.
struct InvalidRows {
  std::size_t known = 0;      ///< Of what the zone told, taken out: the zone tells it again.
  std::size_t reports = 0;    ///< Unfinished reports, left where they are and never sent.
  std::set<Uuid> unsendable;  ///< Those of them that have a uuid.

  std::size_t count() const { return known + reports; }
};

/// Looks through the tables of a LocalHazardMap and takes out of those that the zone's next telling
/// fills again what the program cannot have written. Throws StoreError.
InvalidRows RepairTables(SqliteDatabase& database);

/// SQL's condition for a column `zone` that holds a zone's id, or nothing.
extern const char* const kZoneColumnIsValid;
/// SQL's condition for a row of `pending` whose values have types and sizes that can be fetched.
extern const char* const kFetchableReport;

}  // namespace livemap::vehicle
