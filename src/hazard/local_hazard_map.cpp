#include "hazard/local_hazard_map.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "hazard/report_table.h"

namespace livemap {
namespace {

const std::vector<std::string>& Migrations() {
  static const std::vector<std::string> migrations = {
      std::string("CREATE TABLE known("
                  "  id BLOB PRIMARY KEY,"
                  "  of_zone INTEGER NOT NULL,"
                  "  class_name TEXT NOT NULL,"
                  "  confidence REAL NOT NULL,"
                  "  latitude REAL NOT NULL,"
                  "  longitude REAL NOT NULL,"
                  "  sequence INTEGER NOT NULL,"
                  "  news_ns INTEGER NOT NULL"
                  ") WITHOUT ROWID;"
                  "CREATE INDEX known_by_news ON known(news_ns);") +
      kCreateReportTable};
  return migrations;
}

/// SQLite's words for a damaged file, which StoreError carries.
bool TellsCorruption(const StoreError& error) {
  const std::string sentence = error.what();
  return sentence.find("malformed") != std::string::npos ||
         sentence.find("not a database") != std::string::npos;
}

bool IsUsable(const Notice& notice) {
  if (notice.hazard_uuid.IsNil()) return false;
  if (notice.action == Notice::Action::kRemoved) return true;
  return IsValid(notice.position) && !notice.class_name.empty() &&
         notice.class_name.size() <= kMaxClassNameBytes && notice.confidence >= 0 &&
         notice.confidence <= 1;
}

}  // namespace

LocalHazardMap::LocalHazardMap(const Config& config, const HazardCatalogue& catalogue,
                               std::int64_t now_ns)
    : config_(config), catalogue_(catalogue), filter_(catalogue) {
  try {
    Open();
  } catch (const StoreError& error) {
    if (!TellsCorruption(error)) throw;
    database_.reset();
    SetAside(now_ns);
    Open();
  }
}

void LocalHazardMap::Open() {
  database_ = std::make_unique<SqliteDatabase>(config_.path, /*durable=*/true);
  SqliteStatement check = database_->Prepare("PRAGMA quick_check(1)");
  if (!check.Step() || check.Text(0) != "ok") {
    throw StoreError("store '" + config_.path + "' is malformed: " + check.Text(0));
  }
  check.Reset();
  database_->Migrate(Migrations());
  LoadFilter();
}

void LocalHazardMap::SetAside(std::int64_t now_ns) {
  const std::string target = config_.path + ".corrupt-" + std::to_string(now_ns);
  for (const char* companion : {"", "-wal", "-shm"}) {
    std::error_code error;
    std::filesystem::rename(config_.path + companion, target + companion, error);
    if (error && error != std::errc::no_such_file_or_directory) {
      throw StoreError("store '" + config_.path + "' is corrupt and cannot be renamed to '" +
                       target + "': " + error.message());
    }
  }
  set_aside_ = target;
}

void LocalHazardMap::LoadFilter() {
  filter_ = DuplicateFilter(catalogue_);
  SqliteStatement rows = database_->Prepare("SELECT id,class_name,latitude,longitude FROM known");
  while (rows.Step()) {
    const GeoPoint position{rows.Real(2), rows.Real(3)};
    if (IsValid(position)) filter_.Put(UuidFromBlob(rows.Blob(0)), rows.Text(1), position);
  }
  SqliteStatement count = database_->Prepare("SELECT count(*) FROM pending");
  count.Step();
  pending_count_ = static_cast<std::size_t>(count.Int(0));
}

std::optional<DuplicateFilter::Match> LocalHazardMap::Find(const std::string& class_name,
                                                           const GeoPoint& position) const {
  return filter_.Find(class_name, position);
}

LocalHazardMap::AddResult LocalHazardMap::Add(const Report& report) {
  if (filter_.Find(report.class_name, report.position)) return AddResult::kDuplicate;
  if (pending_count_ >= static_cast<std::size_t>(config_.max_pending)) return AddResult::kFull;
  std::vector<Uuid> evicted;
  database_->Transaction([&] {
    SqliteStatement known = database_->Prepare(
        "INSERT INTO known(id,of_zone,class_name,confidence,latitude,longitude,sequence,news_ns)"
        " VALUES(?,0,?,?,?,?,0,?)");
    known.BindBlob(1, report.uuid.bytes.data(), report.uuid.bytes.size())
        .Bind(2, report.class_name)
        .Bind(3, static_cast<double>(report.confidence))
        .Bind(4, report.position.latitude_deg)
        .Bind(5, report.position.longitude_deg)
        .Bind(6, report.stamp_ns)
        .Execute();
    InsertReport(*database_, report);
    evicted = EvictBeyondLimit();
  });
  filter_.Put(report.uuid, report.class_name, report.position);
  for (const Uuid& id : evicted) filter_.Remove(id);
  ++pending_count_;
  ++revision_;
  return AddResult::kAdded;
}

std::size_t LocalHazardMap::Apply(const std::vector<Notice>& notices) {
  std::vector<const Notice*> news;
  std::vector<Uuid> evicted;
  std::size_t unusable = 0;
  database_->Transaction([&] {
    for (const Notice& notice : notices) {
      if (!IsUsable(notice)) {
        ++unusable;
      } else if (IsNews(notice)) {
        StoreNotice(notice);
        news.push_back(&notice);
      }
    }
    evicted = EvictBeyondLimit();
  });
  for (const Notice* notice : news) {
    if (notice->action == Notice::Action::kRemoved) {
      filter_.Remove(notice->hazard_uuid);
    } else {
      filter_.Put(notice->hazard_uuid, notice->class_name, notice->position);
    }
  }
  for (const Uuid& id : evicted) filter_.Remove(id);
  if (!news.empty()) ++revision_;
  return unusable;
}

bool LocalHazardMap::IsNews(const Notice& notice) const {
  SqliteStatement query = database_->Prepare("SELECT sequence FROM known WHERE id=? AND of_zone=1");
  query.BindBlob(1, notice.hazard_uuid.bytes.data(), notice.hazard_uuid.bytes.size());
  if (!query.Step()) return notice.action != Notice::Action::kRemoved;
  return static_cast<std::int64_t>(notice.sequence) > query.Int(0);
}

void LocalHazardMap::StoreNotice(const Notice& notice) {
  const auto& id = notice.hazard_uuid.bytes;
  if (notice.action == Notice::Action::kRemoved) {
    database_->Prepare("DELETE FROM known WHERE id=?").BindBlob(1, id.data(), id.size()).Execute();
    return;
  }
  SqliteStatement upsert = database_->Prepare(
      "INSERT OR REPLACE INTO"
      " known(id,of_zone,class_name,confidence,latitude,longitude,sequence,news_ns)"
      " VALUES(?,1,?,?,?,?,?,?)");
  upsert.BindBlob(1, id.data(), id.size())
      .Bind(2, notice.class_name)
      .Bind(3, static_cast<double>(notice.confidence))
      .Bind(4, notice.position.latitude_deg)
      .Bind(5, notice.position.longitude_deg)
      .Bind(6, static_cast<std::int64_t>(notice.sequence))
      .Bind(7, notice.stamp_ns)
      .Execute();
}

std::vector<Uuid> LocalHazardMap::EvictBeyondLimit() {
  SqliteStatement count = database_->Prepare("SELECT count(*) FROM known");
  count.Step();
  const std::int64_t excess = count.Int(0) - config_.max_known;
  if (excess <= 0) return {};
  SqliteStatement oldest = database_->Prepare(
      "SELECT id FROM known WHERE id NOT IN (SELECT uuid FROM pending)"
      " ORDER BY news_ns LIMIT ?");
  oldest.Bind(1, excess);
  std::vector<Uuid> evicted;
  while (oldest.Step()) evicted.push_back(UuidFromBlob(oldest.Blob(0)));
  SqliteStatement remove = database_->Prepare("DELETE FROM known WHERE id=?");
  for (const Uuid& id : evicted) remove.BindBlob(1, id.bytes.data(), id.bytes.size()).Execute();
  return evicted;
}

bool LocalHazardMap::Apply(const Receipt& receipt) {
  const auto report = LoadPending(receipt.report_uuid);
  if (!report) return false;
  const auto& own_id = receipt.report_uuid.bytes;
  const auto& zone_id = receipt.hazard_uuid.bytes;
  const bool renames = receipt.status == Receipt::Status::kCommitted &&
                       !receipt.hazard_uuid.IsNil() && filter_.Knows(receipt.report_uuid);
  database_->Transaction([&] {
    database_->Prepare("DELETE FROM pending WHERE uuid=?")
        .BindBlob(1, own_id.data(), own_id.size())
        .Execute();
    if (!renames) return;
    // The zone may have announced it already: its word about the place counts.
    database_->Prepare("UPDATE OR IGNORE known SET id=?, of_zone=1 WHERE id=?")
        .BindBlob(1, zone_id.data(), zone_id.size())
        .BindBlob(2, own_id.data(), own_id.size())
        .Execute();
    if (receipt.report_uuid == receipt.hazard_uuid) return;
    database_->Prepare("DELETE FROM known WHERE id=?")
        .BindBlob(1, own_id.data(), own_id.size())
        .Execute();
  });
  --pending_count_;
  if (!renames) return true;
  if (receipt.report_uuid != receipt.hazard_uuid) filter_.Remove(receipt.report_uuid);
  if (!filter_.Knows(receipt.hazard_uuid)) {
    filter_.Put(receipt.hazard_uuid, report->class_name, report->position);
  }
  ++revision_;
  return true;
}

std::vector<LocalHazardMap::PendingReport> LocalHazardMap::Pending() const {
  SqliteStatement rows = database_->Prepare(
      "SELECT uuid,class_name,stamp_ns,sent FROM pending ORDER BY stamp_ns,uuid");
  std::vector<PendingReport> pending;
  while (rows.Step()) {
    pending.push_back({UuidFromBlob(rows.Blob(0)), rows.Text(1), rows.Int(2), rows.Int(3) != 0});
  }
  return pending;
}

std::optional<Report> LocalHazardMap::LoadPending(const Uuid& uuid) const {
  return SelectReport(*database_, uuid);
}

void LocalHazardMap::MarkSent(const Uuid& uuid) {
  database_->Prepare("UPDATE pending SET sent=1 WHERE uuid=?")
      .BindBlob(1, uuid.bytes.data(), uuid.bytes.size())
      .Execute();
}

std::vector<KnownHazard> LocalHazardMap::Known(std::size_t limit) const {
  SqliteStatement rows = database_->Prepare(
      "SELECT id,of_zone,class_name,confidence,latitude,longitude FROM known"
      " ORDER BY news_ns DESC LIMIT ?");
  rows.Bind(1, static_cast<std::int64_t>(limit));
  std::vector<KnownHazard> known;
  while (rows.Step()) {
    known.push_back({UuidFromBlob(rows.Blob(0)),
                     rows.Int(1) != 0,
                     rows.Text(2),
                     static_cast<float>(rows.Real(3)),
                     {rows.Real(4), rows.Real(5)}});
  }
  return known;
}

}  // namespace livemap
