#include "vehicle/outbox/map_change_outbox.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "common/time.h"
#include "vehicle/outbox/pending_table.h"
#include "vehicle/outbox/row_validation.h"

namespace livemap::vehicle {
namespace {

/// All changes are as urgent as each other.
constexpr int kChangeUrgency = 1;

const std::vector<std::string>& MapChangeMigrations() {
  static const std::vector<std::string> migrations = {
      R"sql(
    CREATE TABLE pending(
      uuid BLOB PRIMARY KEY, drive_id TEXT NOT NULL, stamp_ns INTEGER NOT NULL,
      earlier_stamp_ns INTEGER NOT NULL, class_name TEXT NOT NULL, vanished INTEGER NOT NULL,
      confidence REAL NOT NULL, seen INTEGER NOT NULL, missed INTEGER NOT NULL,
      latitude REAL NOT NULL, longitude REAL NOT NULL,
      var_east REAL NOT NULL, cov_east_north REAL NOT NULL, var_north REAL NOT NULL
    ) WITHOUT ROWID)sql",
      // Empty: that of before is named at the start.
      "ALTER TABLE pending ADD COLUMN zone TEXT "
      "NOT NULL DEFAULT ''"};
  return migrations;
}

void InsertMapChange(SqliteDatabase& database, const protocol::MapChangeReport& report) {
  SqliteStatement insert =
      database.Prepare("INSERT OR REPLACE INTO pending VALUES(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)");
  insert.BindBlob(1, report.uuid.bytes.data(), report.uuid.bytes.size())
      .Bind(2, report.drive_id)
      .Bind(3, report.stamp_ns)
      .Bind(4, report.earlier_stamp_ns)
      .Bind(5, report.class_name)
      .Bind(6, static_cast<std::int64_t>(report.vanished))
      .Bind(7, static_cast<double>(report.confidence))
      .Bind(8, static_cast<std::int64_t>(report.seen))
      .Bind(9, static_cast<std::int64_t>(report.missed))
      .Bind(10, report.position.latitude_deg)
      .Bind(11, report.position.longitude_deg)
      .Bind(12, report.covariance_m2(0, 0))
      .Bind(13, report.covariance_m2(0, 1))
      .Bind(14, report.covariance_m2(1, 1))
      .Bind(15, report.zone);
  insert.Execute();
}

protocol::MapChangeReport ReadMapChangeRow(const SqliteStatement& row) {
  protocol::MapChangeReport report;
  report.uuid = UuidFromBlob(row.Blob(0));
  report.drive_id = row.Text(1);
  report.stamp_ns = row.Int(2);
  report.earlier_stamp_ns = row.Int(3);
  report.class_name = row.Text(4);
  report.vanished = row.Int(5) != 0;
  report.confidence = static_cast<float>(row.Real(6));
  report.seen = static_cast<std::uint32_t>(row.Int(7));
  report.missed = static_cast<std::uint32_t>(row.Int(8));
  report.position = {row.Real(9), row.Real(10)};
  report.covariance_m2 << row.Real(11), row.Real(12), row.Real(12), row.Real(13);
  report.zone = row.Text(14);
  return report;
}

}  // namespace

bool IsSound(const protocol::MapChangeReport& report) {
  const auto is_name = [](const std::string& text) {
    return !text.empty() && text.size() <= kMaxIdBytes;
  };
  return !report.uuid.IsNil() && is_name(report.drive_id) && is_name(report.class_name) &&
         IsStamp(report.stamp_ns) && IsStamp(report.earlier_stamp_ns) && report.confidence >= 0 &&
         report.confidence <= 1 && report.seen >= 2 && geo::IsValid(report.position) &&
         IsCovarianceOfReport(report.covariance_m2);
}

MapChangeOutbox::MapChangeOutbox(const Config& config, std::mt19937_64 random, std::int64_t now_ns,
                                 double steady_s)
    : config_(config), schedule_(config.resend, random) {
  set_aside_ = OpenOrQuarantine(config_.path, MapChangeMigrations(), now_ns, database_, [] {});
  Load(steady_s);
}

/// The zone of what names the zone `named`, or none.
std::string MapChangeOutbox::ZoneOf(const std::string& named) const {
  if (config_.zone.empty()) return "";
  return named.empty() ? config_.zone : named;
}

void MapChangeOutbox::Load(double steady_s) {
  if (config_.zone.empty()) {
    database_->Execute("UPDATE pending SET zone='' WHERE zone<>''");
  } else {
    database_->Prepare("UPDATE pending SET zone=? WHERE zone=''").Bind(1, config_.zone).Execute();
  }
  // Of a text that something else made endless only the beginning is fetched: too long as it is.
  SqliteStatement rows = database_->Prepare(
      "SELECT substr(uuid, 1, 17), substr(drive_id, 1, 65), stamp_ns, earlier_stamp_ns, "
      "substr(class_name, 1, 65), vanished, confidence, seen, missed, latitude, longitude, "
      "var_east, cov_east_north, var_north, substr(zone, 1, 65) FROM pending");
  while (rows.Step()) {
    const protocol::MapChangeReport report = ReadMapChangeRow(rows);
    if (!IsSound(report) || report.zone.size() > kMaxIdBytes) {
      ++counters_.unsound;
      continue;
    }
    pending_[report.uuid] = report;
    schedule_.Add(report.uuid, kChangeUrgency, report.stamp_ns, steady_s);
  }
  Displace();
}

void MapChangeOutbox::Add(const protocol::MapChangeReport& report, double steady_s) {
  if (!IsSound(report)) {
    throw Error("a change of class '" + report.class_name.substr(0, kMaxIdBytes) +
                "' has values that no zone accepts");
  }
  protocol::MapChangeReport stored = report;
  if (zones_.zone_at) stored.zone = zones_.zone_at(report.position);
  stored.zone = ZoneOf(stored.zone);
  InsertMapChange(*database_, stored);
  pending_[report.uuid] = std::move(stored);
  schedule_.Add(report.uuid, kChangeUrgency, report.stamp_ns, steady_s);
  ++counters_.added;
  Displace();
}

std::vector<protocol::MapChangeReport> MapChangeOutbox::TakeDue(double steady_s,
                                                                std::size_t limit) {
  std::vector<protocol::MapChangeReport> reports;
  for (const Uuid& uuid : schedule_.TakeDue(steady_s, limit)) {
    ++(schedule_.WasSent(uuid) ? counters_.resends : counters_.sent);
    schedule_.MarkSent(uuid);
    protocol::MapChangeReport& report = pending_.at(uuid);
    Redirect(report);
    reports.push_back(report);
  }
  return reports;
}

void MapChangeOutbox::Redirect(protocol::MapChangeReport& report) {
  const std::string zone = ZoneOf(zones_.Redirect(report.zone, report.position));
  if (zone == report.zone) return;
  database_->Prepare("UPDATE pending SET zone=? WHERE uuid=?")
      .Bind(1, zone)
      .BindBlob(2, report.uuid.bytes.data(), report.uuid.bytes.size())
      .Execute();
  report.zone = zone;
}

void MapChangeOutbox::AddReceipt(const protocol::Receipt& receipt) {
  const auto answered = pending_.find(receipt.report_uuid);
  if (answered == pending_.end() || answered->second.zone != ZoneOf(receipt.zone)) return;
  Erase(receipt.report_uuid);
  ++(receipt.status == protocol::Receipt::Status::kCommitted ? counters_.committed
                                                             : counters_.refused);
}

void MapChangeOutbox::Erase(const Uuid& uuid) {
  ErasePending(*database_, uuid);
  pending_.erase(uuid);
  schedule_.Remove(uuid);
}

void MapChangeOutbox::Displace() {
  while (pending_.size() > config_.most) {
    const auto oldest = std::min_element(
        pending_.begin(), pending_.end(),
        [](const auto& a, const auto& b) { return a.second.stamp_ns < b.second.stamp_ns; });
    Erase(Uuid(oldest->first));
    ++counters_.displaced;
  }
}

}  // namespace livemap::vehicle
