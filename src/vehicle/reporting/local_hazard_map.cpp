#include "vehicle/reporting/local_hazard_map.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "vehicle/outbox/pending_table.h"
#include "vehicle/outbox/report_table.h"

namespace livemap::vehicle {
namespace {

const std::vector<std::string>& LocalHazardMapMigrations() {
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
          kCreateReportTable,
      // Removed hazards are remembered, lest an older notice that comes late brings them back.
      "CREATE TABLE gone(id BLOB PRIMARY KEY, sequence INTEGER NOT NULL) WITHOUT ROWID;"
      "CREATE INDEX gone_by_sequence ON gone(sequence);"
      "CREATE TABLE zone(map_sequence INTEGER NOT NULL);"
      "INSERT INTO zone(map_sequence) VALUES(0);",
      kAddShownRegionAndHold,
      // Every zone counts for itself. GiveRowsTheirZone names the zone of what is there already.
      std::string("ALTER TABLE known ADD COLUMN zone TEXT NOT NULL DEFAULT '';"
                  "CREATE TABLE gone_of_zones(zone TEXT NOT NULL, id BLOB NOT NULL,"
                  "  sequence INTEGER NOT NULL, PRIMARY KEY(zone, id)) WITHOUT ROWID;"
                  "INSERT INTO gone_of_zones(zone,id,sequence) SELECT '',id,sequence FROM gone;"
                  "DROP TABLE gone;"
                  "ALTER TABLE gone_of_zones RENAME TO gone;"
                  "CREATE INDEX gone_by_sequence ON gone(zone, sequence);"
                  "CREATE TABLE zones(zone TEXT PRIMARY KEY NOT NULL,"
                  "  map_sequence INTEGER NOT NULL) WITHOUT ROWID;"
                  "INSERT OR IGNORE INTO zones(zone,map_sequence) SELECT '',map_sequence FROM zone;"
                  "DROP TABLE zone;") +
          kAddZoneOfReport,
      // Of cells of the map each counts for itself, too.
      "CREATE TABLE cells(zone TEXT NOT NULL, cell INTEGER NOT NULL, sequence INTEGER NOT NULL,"
      "  PRIMARY KEY(zone, cell)) WITHOUT ROWID;",
      // NULL where it is not known. Cells are asked about anew, for the courses of what is known.
      "ALTER TABLE known ADD COLUMN course_rad REAL;"
      "DELETE FROM cells;",
      // As protocol::TrailsText writes them; NULL where none is known. As above.
      "ALTER TABLE known ADD COLUMN trails TEXT;"
      "DELETE FROM cells;"};
  return migrations;
}

constexpr int kGoneKept = 10000;
/// Told hazards between two kCaughtUp; the zone tells fewer.
constexpr std::size_t kMaxTold = 200000;
/// Zones of which anything is remembered; a zone directory has no more.
constexpr std::size_t kMaxZones = 5000;
/// Cells of which the vehicle remembers how far it knows them: some 10 000 square kilometres.
constexpr std::size_t kMaxCells = 20000;
/// As the tables take them (row_validation).
constexpr std::uint64_t kMaxStoredSequence = (std::uint64_t{1} << 60) - 1;

bool IsUsableNotice(const protocol::Notice& notice) {
  if (notice.sequence > std::numeric_limits<std::int64_t>::max()) return false;
  if (notice.action == protocol::Notice::Action::kCaughtUp) {
    return geo::IsValid(notice.position) && notice.radius_m >= 0 && notice.radius_m <= 1e6;
  }
  if (notice.hazard_uuid.IsNil()) return false;
  if (notice.action == protocol::Notice::Action::kRemoved) return true;
  return geo::IsValid(notice.position) && !notice.class_name.empty() &&
         notice.class_name.size() <= protocol::kMaxClassNameBytes && notice.confidence >= 0 &&
         notice.confidence <= 1 && protocol::IsCourseOfPass(notice.course_rad);
}

}  // namespace

LocalHazardMap::LocalHazardMap(const Config& config, const protocol::HazardCatalogue& catalogue,
                               std::int64_t now_ns)
    : config_(config), catalogue_(catalogue), filter_(catalogue) {
  set_aside_ =
      OpenOrQuarantine(config_.path, LocalHazardMapMigrations(), now_ns, database_, [this] {
        broken_rows_ = RepairTables(*database_);
        GiveRowsTheirZone();
        LoadFilter();
      });
  if (!set_aside_.empty()) RecoverFromSetAside();
}

/// The zone of what names the zone `named`, or none.
std::string LocalHazardMap::ZoneOf(const std::string& named) const {
  if (config_.zone.empty()) return "";
  return named.empty() ? config_.zone : named;
}

void LocalHazardMap::GiveRowsTheirZone() {
  if (config_.zone.empty()) {
    // There is one zone now, which has all of it or tells what is gone. A report whose zone has no
    // possible name stays broken, as it was counted.
    database_->Transaction([&] {
      database_->Execute(
          std::string("UPDATE known SET zone='', sequence=min(sequence,1) WHERE zone<>'';"
                      "DELETE FROM gone WHERE zone<>''; DELETE FROM zones WHERE zone<>'';"
                      "DELETE FROM cells WHERE zone<>'';"
                      "UPDATE pending SET zone='' WHERE zone<>'' AND ") +
          kZoneColumnIsValid);
    });
    return;
  }
  database_->Transaction([&] {
    for (const char* table : {"known", "pending", "gone", "zones", "cells"}) {
      // Where the zone has a row of its own, that is the newer one.
      database_->Prepare(std::string("UPDATE OR IGNORE ") + table + " SET zone=? WHERE zone=''")
          .Bind(1, config_.zone)
          .Execute();
    }
    database_->Execute(
        "DELETE FROM gone WHERE zone=''; DELETE FROM zones WHERE zone='';"
        "DELETE FROM cells WHERE zone='';");
  });
}

void LocalHazardMap::RecoverFromSetAside() {
  // So that the first page of the new file is in the file itself.
  database_->Prepare("PRAGMA wal_checkpoint(TRUNCATE)").Execute();
  salvage_ = SalvageReports(set_aside_, config_.path, [this](const StoredReport& stored) {
    protocol::Report report = stored.report;
    if (LoadPending(report.uuid)) return;
    report.zone = ZoneOf(report.zone);
    database_->Transaction([&] {
      InsertReport(*database_, report, stored.hold_until_ns);
      if (!filter_.Find(report.class_name, report.position)) InsertKnown(report, report.zone);
    });
    if (stored.sent) MarkSent(report.uuid);
  });
  LoadFilter();
}

void LocalHazardMap::LoadFilter() {
  filter_ = protocol::DuplicateFilter(catalogue_);
  SqliteStatement rows = database_->Prepare("SELECT id,class_name,latitude,longitude FROM known");
  while (rows.Step()) {
    filter_.Put(UuidFromBlob(rows.Blob(0)), rows.Text(1), {rows.Real(2), rows.Real(3)});
  }
  zones_.clear();
  SqliteStatement zones = database_->Prepare("SELECT zone,map_sequence FROM zones");
  while (zones.Step() && zones_.size() < kMaxZones) {
    zones_[zones.Text(0)].chain = NoticeSequenceTracker(static_cast<std::uint64_t>(zones.Int(1)));
  }
  cells_.clear();
  SqliteStatement cells = database_->Prepare("SELECT zone,cell,sequence FROM cells");
  while (cells.Step() && cells_.size() < kMaxCells) {
    cells_[{cells.Text(0), static_cast<std::uint32_t>(cells.Int(1))}] =
        NoticeSequenceTracker(static_cast<std::uint64_t>(cells.Int(2)));
  }
  CountPending();
}

void LocalHazardMap::CountPending() {
  SqliteStatement sizes = database_->Prepare(
      std::string("SELECT uuid,length(CAST(image AS BLOB)) FROM pending WHERE ") +
      kFetchableReport);
  pending_count_ = pending_bytes_ = 0;
  while (sizes.Step()) {
    if (broken_rows_.unsendable.count(UuidFromBlob(sizes.Blob(0))) != 0) continue;
    ++pending_count_;
    pending_bytes_ += static_cast<std::size_t>(sizes.Int(1)) + kReportBytes;
  }
}

std::optional<protocol::DuplicateFilter::Match> LocalHazardMap::Find(
    const std::string& class_name, const geo::GeoPoint& position) const {
  return filter_.Find(class_name, position);
}

LocalHazardMap::AddResult LocalHazardMap::Add(const protocol::Report& report,
                                              std::int64_t hold_until_ns) {
  if (filter_.Find(report.class_name, report.position)) return AddResult::kDuplicate;
  const std::size_t bytes = report.image.size() + kReportBytes;
  if (pending_count_ >= static_cast<std::size_t>(config_.max_pending) ||
      static_cast<double>(pending_bytes_ + bytes) > config_.max_pending_bytes) {
    return AddResult::kFull;
  }
  std::vector<Change> changes = {{report.uuid, true, report.class_name, report.position}};
  Chains cells;
  protocol::Report stored = report;
  stored.zone = ZoneOf(report.zone);
  database_->Transaction([&] {
    InsertKnown(stored, stored.zone);
    InsertReport(*database_, stored, hold_until_ns);
    EvictBeyondLimit(changes, cells);
  });
  Show(changes);
  for (auto& [key, chain] : cells) cells_[key] = std::move(chain);
  ++pending_count_;
  pending_bytes_ += bytes;
  return AddResult::kAdded;
}

void LocalHazardMap::InsertKnown(const protocol::Report& report, const std::string& zone) {
  SqliteStatement known = database_->Prepare(
      "INSERT INTO known(id,of_zone,class_name,confidence,latitude,longitude,sequence,news_ns,zone)"
      " VALUES(?,0,?,?,?,?,0,?,?)");
  known.BindBlob(1, report.uuid.bytes.data(), report.uuid.bytes.size())
      .Bind(2, report.class_name)
      .Bind(3, static_cast<double>(report.confidence))
      .Bind(4, report.position.latitude_deg)
      .Bind(5, report.position.longitude_deg)
      .Bind(6, report.stamp_ns)
      .Bind(7, zone)
      .Execute();
}

/// The filter learns what a transaction did.
void LocalHazardMap::Show(const std::vector<Change>& changes) {
  for (const Change& change : changes) {
    if (change.known) {
      filter_.Put(change.id, change.class_name, change.position);
    } else {
      filter_.Remove(change.id);
    }
  }
}

void LocalHazardMap::Forget(const Uuid& id, std::vector<Change>& changes) {
  database_->Prepare("DELETE FROM known WHERE id=?")
      .BindBlob(1, id.bytes.data(), id.bytes.size())
      .Execute();
  changes.push_back({id, false, "", {}});
}

/// Of a cell of which something is forgotten the vehicle does not know all any more.
void LocalHazardMap::EvictBeyondLimit(std::vector<Change>& changes, Chains& cells) {
  SqliteStatement count = database_->Prepare("SELECT count(*) FROM known");
  count.Step();
  const std::int64_t excess = count.Int(0) - config_.max_known;
  if (excess <= 0) return;
  SqliteStatement oldest = database_->Prepare(
      "SELECT id,zone,latitude,longitude FROM known"
      " WHERE id NOT IN (SELECT uuid FROM pending WHERE uuid IS NOT NULL) ORDER BY news_ns LIMIT "
      "?");
  oldest.Bind(1, excess);
  std::vector<Uuid> evicted;
  std::set<CellKey> evicted_from;
  while (oldest.Step()) {
    evicted.push_back(UuidFromBlob(oldest.Blob(0)));
    const geo::MapCell cell = geo::MapCell::At({oldest.Real(2), oldest.Real(3)});
    evicted_from.emplace(oldest.Text(1), cell.number());
  }
  for (const Uuid& id : evicted) Forget(id, changes);
  for (const CellKey& key : evicted_from) {
    if (RememberCell(key, cells).known() == 0) continue;
    cells[key] = NoticeSequenceTracker();
    database_->Prepare("DELETE FROM cells WHERE zone=? AND cell=?")
        .Bind(1, key.first)
        .Bind(2, static_cast<std::int64_t>(key.second))
        .Execute();
  }
}

std::size_t LocalHazardMap::ForgetUnannounced(std::int64_t now_ns) {
  std::vector<Uuid> passed;
  SqliteStatement rows =
      database_->Prepare("SELECT id,class_name,news_ns FROM known WHERE of_zone=1 AND sequence=0");
  while (rows.Step()) {
    const double age_s = static_cast<double>(now_ns - rows.Int(2)) * 1e-9;
    if (age_s > catalogue_.Get(rows.Text(1)).expected_life_s) {
      passed.push_back(UuidFromBlob(rows.Blob(0)));
    }
  }
  if (passed.empty()) return 0;
  std::vector<Change> changes;
  database_->Transaction([&] {
    for (const Uuid& id : passed) Forget(id, changes);
  });
  Show(changes);
  return passed.size();
}

bool LocalHazardMap::Apply(const protocol::Receipt& receipt) {
  const auto report = LoadPending(receipt.report_uuid);
  if (!report || report->zone != ZoneOf(receipt.zone)) return false;
  const auto& own_id = receipt.report_uuid.bytes;
  const auto& zone_id = receipt.hazard_uuid.bytes;
  const bool renames = receipt.status == protocol::Receipt::Status::kCommitted &&
                       !receipt.hazard_uuid.IsNil() && filter_.Knows(receipt.report_uuid);
  database_->Transaction([&] {
    ErasePending(*database_, receipt.report_uuid);
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
  pending_bytes_ -= report->image.size() + kReportBytes;
  if (!renames) return true;
  if (receipt.report_uuid != receipt.hazard_uuid) filter_.Remove(receipt.report_uuid);
  if (!filter_.Knows(receipt.hazard_uuid)) {
    filter_.Put(receipt.hazard_uuid, report->class_name, report->position);
  }
  return true;
}

void LocalHazardMap::GiveZone(const Uuid& report, const std::string& zone) {
  database_->Transaction([&] {
    for (const char* row : {"pending SET zone=? WHERE uuid=?", "known SET zone=? WHERE id=?"}) {
      database_->Prepare(std::string("UPDATE ") + row)
          .Bind(1, zone)
          .BindBlob(2, report.bytes.data(), report.bytes.size())
          .Execute();
    }
  });
}

void LocalHazardMap::ForgetZones(const std::function<bool(const std::string&)>& is_gone) {
  std::vector<std::string> gone;
  SqliteStatement zones = database_->Prepare(
      "SELECT zone FROM known WHERE of_zone=1"
      " UNION SELECT zone FROM zones UNION SELECT zone FROM cells");
  while (zones.Step()) {
    const std::string zone = zones.Text(0);
    if (zone != config_.zone && is_gone(zone)) gone.push_back(zone);
  }
  if (gone.empty()) return;
  std::vector<Change> changes;
  database_->Transaction([&] {
    for (const std::string& zone : gone) {
      SqliteStatement rows = database_->Prepare("SELECT id FROM known WHERE zone=? AND of_zone=1");
      rows.Bind(1, zone);
      std::vector<Uuid> told;
      while (rows.Step()) told.push_back(UuidFromBlob(rows.Blob(0)));
      for (const Uuid& id : told) Forget(id, changes);
      for (const char* table : {"gone", "zones", "cells"}) {
        database_->Prepare(std::string("DELETE FROM ") + table + " WHERE zone=?")
            .Bind(1, zone)
            .Execute();
      }
    }
  });
  Show(changes);
  for (const std::string& zone : gone) {
    zones_.erase(zone);
    cells_.erase(cells_.lower_bound({zone, 0}), cells_.upper_bound({zone, UINT32_MAX}));
  }
}

std::vector<LocalHazardMap::PendingReport> LocalHazardMap::Pending() const {
  SqliteStatement rows = database_->Prepare(
      std::string("SELECT uuid,class_name,stamp_ns,sent,hold_until_ns FROM pending WHERE ") +
      kFetchableReport + " ORDER BY stamp_ns,uuid");
  std::vector<PendingReport> pending;
  while (rows.Step()) {
    const Uuid uuid = UuidFromBlob(rows.Blob(0));
    if (broken_rows_.unsendable.count(uuid) != 0) continue;
    pending.push_back({uuid, rows.Text(1), rows.Int(2), rows.Int(3) != 0, rows.Int(4)});
  }
  return pending;
}

std::optional<protocol::Report> LocalHazardMap::LoadPending(const Uuid& uuid) const {
  if (broken_rows_.unsendable.count(uuid) != 0) return std::nullopt;
  SqliteStatement row =
      database_->Prepare(std::string("SELECT 1 FROM pending WHERE uuid=? AND ") + kFetchableReport);
  row.BindBlob(1, uuid.bytes.data(), uuid.bytes.size());
  if (!row.Step()) return std::nullopt;
  row.Reset();
  return SelectReport(*database_, uuid);
}

void LocalHazardMap::MarkSent(const Uuid& uuid) {
  database_->Prepare("UPDATE pending SET sent=1 WHERE uuid=?")
      .BindBlob(1, uuid.bytes.data(), uuid.bytes.size())
      .Execute();
}

std::vector<KnownHazard> LocalHazardMap::Known(std::size_t limit) const {
  SqliteStatement rows = database_->Prepare(
      "SELECT id,of_zone,class_name,confidence,latitude,longitude,zone FROM known"
      " ORDER BY news_ns DESC LIMIT ?");
  rows.Bind(1, static_cast<std::int64_t>(limit));
  std::vector<KnownHazard> known;
  while (rows.Step()) {
    known.push_back({UuidFromBlob(rows.Blob(0)),
                     rows.Int(1) != 0,
                     rows.Text(2),
                     static_cast<float>(rows.Real(3)),
                     {rows.Real(4), rows.Real(5)},
                     rows.Text(6)});
  }
  return known;
}

std::uint64_t LocalHazardMap::map_sequence(const std::string& zone) const {
  const auto found = zones_.find(ZoneOf(zone));
  return found == zones_.end() ? 0 : found->second.chain.known();
}

bool LocalHazardMap::has_gap() const {
  return std::any_of(zones_.begin(), zones_.end(),
                     [](const auto& zone) { return zone.second.chain.has_gap(); }) ||
         std::any_of(cells_.begin(), cells_.end(),
                     [](const auto& cell) { return cell.second.has_gap(); });
}

std::uint64_t LocalHazardMap::cell_sequence(const std::string& zone,
                                            const geo::MapCell& cell) const {
  const auto found = cells_.find({ZoneOf(zone), cell.number()});
  return found == cells_.end() ? 0 : found->second.known();
}

bool LocalHazardMap::has_cell_gap(const std::string& zone, const geo::MapCell& cell) const {
  const auto found = cells_.find({ZoneOf(zone), cell.number()});
  return found != cells_.end() && found->second.has_gap();
}

std::size_t LocalHazardMap::Apply(const std::vector<protocol::Notice>& notices) {
  Taking taking;
  std::size_t unusable = 0;
  database_->Transaction([&] {
    for (const protocol::Notice& notice : notices) {
      const std::string zone = ZoneOf(notice.zone);
      ZoneMemory* memory = Remember(zone, taking.zones);
      const NoticeUse use =
          memory == nullptr ? NoticeUse::kUnusable : ApplyNotice(notice, zone, *memory, taking);
      if (use != NoticeUse::kTaken) ++unusable;
      if (use == NoticeUse::kBeyondZone) ++taking.beyond_zone;
    }
    EvictBeyondLimit(taking.changes, taking.cells);
    WriteSequences(taking);
  });
  Keep(std::move(taking));
  return unusable;
}

LocalHazardMap::CellUse LocalHazardMap::Apply(const protocol::CellNews& news) {
  Taking taking;
  CellUse use;
  const std::string zone = ZoneOf(news.zone);
  database_->Transaction([&] {
    for (const protocol::CellNews::Cell& cell : news.cells) {
      if (TakeCell(cell, zone, taking, use.unusable)) {
        use.known.push_back(cell.cell);
      } else {
        ++use.unusable;
      }
    }
    EvictBeyondLimit(taking.changes, taking.cells);
    WriteSequences(taking);
  });
  Keep(std::move(taking));
  return use;
}

/// False when the cell is not known with this: what the vehicle knew of it was lost meanwhile.
bool LocalHazardMap::TakeCell(const protocol::CellNews::Cell& cell, const std::string& zone,
                              Taking& taking, std::size_t& unusable) {
  NoticeSequenceTracker& chain = RememberCell({zone, cell.cell.number()}, taking.cells);
  if (cell.sequence > kMaxStoredSequence || cell.since > kMaxStoredSequence) return false;
  if (!cell.is_whole() && cell.since > chain.known()) return false;
  const bool began_anew = cell.since > cell.sequence;
  if (began_anew) {
    // What the zone said under higher numbers, it said before it began anew.
    database_->Prepare("DELETE FROM gone WHERE zone=? AND sequence>?")
        .Bind(1, zone)
        .Bind(2, static_cast<std::int64_t>(cell.sequence))
        .Execute();
    ForgetOfCell(cell, zone, {}, taking.changes);
  }
  std::set<Uuid> told;
  for (const protocol::CellNews::Hazard& hazard : cell.hazards) {
    protocol::Notice notice;
    notice.action =
        hazard.removed ? protocol::Notice::Action::kRemoved : protocol::Notice::Action::kUpdated;
    notice.sequence = hazard.sequence;
    notice.hazard_uuid = hazard.hazard_uuid;
    notice.class_name = hazard.class_name;
    notice.confidence = hazard.confidence;
    notice.position = hazard.position;
    notice.stamp_ns = hazard.stamp_ns;
    notice.course_rad = hazard.course_rad;
    notice.trails = hazard.trails;
    const bool is_usable = hazard.sequence <= kMaxStoredSequence && IsUsableNotice(notice);
    const NoticeUse use =
        is_usable ? TakeHazard(notice, zone, taking.changes) : NoticeUse::kUnusable;
    if (use != NoticeUse::kTaken) ++unusable;
    if (use == NoticeUse::kBeyondZone) ++taking.beyond_zone;
    if (!hazard.removed) told.insert(hazard.hazard_uuid);
  }
  if (cell.is_whole() && !began_anew) ForgetOfCell(cell, zone, told, taking.changes);
  if (began_anew) {
    chain = NoticeSequenceTracker(cell.sequence);
  } else {
    chain.CloseTo(cell.sequence);
  }
  return true;
}

/// What the zone said is in the cell, up to the sequence with which all of it was told, and was not
/// told then; all of it where the zone began anew.
void LocalHazardMap::ForgetOfCell(const protocol::CellNews::Cell& cell, const std::string& zone,
                                  const std::set<Uuid>& told, std::vector<Change>& changes) {
  const bool began_anew = cell.since > cell.sequence;
  SqliteStatement rows = database_->Prepare(
      "SELECT id,latitude,longitude FROM known WHERE of_zone=1 AND zone=? AND sequence>0 AND"
      " sequence<=? AND latitude BETWEEN ? AND ?");
  rows.Bind(1, zone)
      .Bind(2, static_cast<std::int64_t>(began_anew ? kMaxStoredSequence : cell.sequence))
      .Bind(3, cell.cell.SouthDeg())
      .Bind(4, cell.cell.NorthDeg());
  std::vector<Uuid> left_out;
  while (rows.Step()) {
    const Uuid id = UuidFromBlob(rows.Blob(0));
    if (told.count(id) != 0) continue;
    if (geo::MapCell::At({rows.Real(1), rows.Real(2)}) == cell.cell) left_out.push_back(id);
  }
  for (const Uuid& id : left_out) Forget(id, changes);
}

/// Up to where the vehicle knows the zones and cells that said something.
void LocalHazardMap::WriteSequences(const Taking& taking) {
  for (const auto& [zone, memory] : taking.zones) {
    if (memory.chain.known() == map_sequence(zone)) continue;
    database_->Prepare("INSERT OR REPLACE INTO zones(zone,map_sequence) VALUES(?,?)")
        .Bind(1, zone)
        .Bind(2, static_cast<std::int64_t>(memory.chain.known()))
        .Execute();
  }
  for (const auto& [key, chain] : taking.cells) {
    const auto before = cells_.find(key);
    if (chain.known() == (before == cells_.end() ? 0 : before->second.known())) continue;
    database_->Prepare("INSERT OR REPLACE INTO cells(zone,cell,sequence) VALUES(?,?,?)")
        .Bind(1, key.first)
        .Bind(2, static_cast<std::int64_t>(key.second))
        .Bind(3, static_cast<std::int64_t>(chain.known()))
        .Execute();
  }
}

/// What was written is in memory, too.
void LocalHazardMap::Keep(Taking taking) {
  Show(taking.changes);
  beyond_zone_ += taking.beyond_zone;
  for (auto& [zone, memory] : taking.zones) zones_[zone] = std::move(memory);
  for (auto& [key, chain] : taking.cells) cells_[key] = std::move(chain);
  if (cells_.size() > kMaxCells) ForgetOldestCells();
}

/// Up to a tenth of them, so that it is done seldom. The vehicle is told them anew when it comes
/// near. They are of the zone that has the most: the sequences of one say nothing of another's.
void LocalHazardMap::ForgetOldestCells() {
  std::map<std::string, std::vector<std::pair<std::uint64_t, CellKey>>> by_zone;
  for (const auto& [key, chain] : cells_) by_zone[key.first].emplace_back(chain.known(), key);
  const auto most = std::max_element(
      by_zone.begin(), by_zone.end(),
      [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
  auto& oldest = most->second;
  std::sort(oldest.begin(), oldest.end());
  oldest.resize(std::min(oldest.size(), kMaxCells / 10));
  database_->Transaction([&] {
    for (const auto& [known, key] : oldest) {
      database_->Prepare("DELETE FROM cells WHERE zone=? AND cell=?")
          .Bind(1, key.first)
          .Bind(2, static_cast<std::int64_t>(key.second))
          .Execute();
    }
  });
  for (const auto& [known, key] : oldest) cells_.erase(key);
}

/// The cell's chain in `cells`, at first as it is in cells_.
NoticeSequenceTracker& LocalHazardMap::RememberCell(const CellKey& key, Chains& cells) const {
  const auto found = cells.find(key);
  if (found != cells.end()) return found->second;
  const auto before = cells_.find(key);
  return cells.emplace(key, before == cells_.end() ? NoticeSequenceTracker() : before->second)
      .first->second;
}

/// The zone's entry in `zones`, at first as it is in zones_; null: too many zones.
LocalHazardMap::ZoneMemory* LocalHazardMap::Remember(
    const std::string& zone, std::map<std::string, ZoneMemory>& zones) const {
  const auto found = zones.find(zone);
  if (found != zones.end()) return &found->second;
  const auto before = zones_.find(zone);
  if (before != zones_.end()) return &zones.emplace(zone, before->second).first->second;
  if (zones_.size() + zones.size() >= kMaxZones) return nullptr;
  return &zones[zone];
}

LocalHazardMap::NoticeUse LocalHazardMap::ApplyNotice(const protocol::Notice& notice,
                                                      const std::string& zone, ZoneMemory& memory,
                                                      Taking& taking) {
  if (!IsUsableNotice(notice)) return NoticeUse::kUnusable;
  if (notice.action == protocol::Notice::Action::kCaughtUp) {
    const bool is_complete = CatchUp(notice, zone, memory, taking.changes);
    memory.told.clear();
    return is_complete ? NoticeUse::kTaken : NoticeUse::kUnusable;
  }
  if (notice.cell) {
    // Of a cell, which says nothing of the rest of the zone.
    RememberCell({zone, notice.cell->number()}, taking.cells)
        .Add(notice.previous_sequence, notice.sequence);
  } else if (notice.vehicle_id.empty()) {
    memory.chain.Add(notice.previous_sequence, notice.sequence);
  } else if (memory.told.size() < kMaxTold) {
    memory.told.insert(notice.hazard_uuid);
  }
  return TakeHazard(notice, zone, taking.changes);
}

/// What it says of the hazard, if that is news.
LocalHazardMap::NoticeUse LocalHazardMap::TakeHazard(const protocol::Notice& notice,
                                                     const std::string& zone,
                                                     std::vector<Change>& changes) {
  // It came, though it counts for nothing: else its zone would tell it again and again.
  if (IsOfAnotherZone(notice.hazard_uuid, zone)) return NoticeUse::kUnusable;
  const bool is_removed = notice.action == protocol::Notice::Action::kRemoved;
  if (!is_removed && is_beyond_ && is_beyond_(zone, notice.position)) {
    return NoticeUse::kBeyondZone;
  }
  if (!IsNews(notice, zone)) {
    LearnPasses(notice, zone);
    return NoticeUse::kTaken;
  }
  StoreNotice(notice, zone);
  changes.push_back({notice.hazard_uuid, !is_removed, notice.class_name, notice.position});
  return NoticeUse::kTaken;
}

/// Takes away what the zone no longer has and closes the gap; false when some of what belongs to
/// this kCaughtUp did not come: then the gap stays open, and the zone tells again.
bool LocalHazardMap::CatchUp(const protocol::Notice& notice, const std::string& zone,
                             ZoneMemory& memory, std::vector<Change>& changes) {
  const bool began_anew = notice.previous_sequence > notice.sequence;
  if (memory.told.size() < notice.told) return false;
  if (notice.previous_sequence > memory.chain.known() && !began_anew) return false;
  if (notice.previous_sequence == 0 || began_anew) {
    for (const Uuid& id : NotTold(notice, zone, memory.told)) Forget(id, changes);
  }
  if (began_anew) {
    memory.chain = NoticeSequenceTracker(notice.sequence);
  } else {
    memory.chain.CloseTo(notice.sequence);
  }
  return true;
}

/// Hazards of the zone that a telling of all that is there left out.
std::vector<Uuid> LocalHazardMap::NotTold(const protocol::Notice& notice, const std::string& zone,
                                          const std::set<Uuid>& told) const {
  const bool began_anew = notice.previous_sequence > notice.sequence;
  SqliteStatement rows = database_->Prepare(
      "SELECT id,latitude,longitude,sequence FROM known WHERE of_zone=1 AND zone=?");
  rows.Bind(1, zone);
  std::vector<Uuid> left_out;
  while (rows.Step()) {
    const Uuid id = UuidFromBlob(rows.Blob(0));
    if (told.count(id) != 0) continue;
    const auto sequence = static_cast<std::uint64_t>(rows.Int(3));
    // Own ones that the zone never announced (0) are not for it to tell, newer ones not yet.
    const bool could_be_told =
        sequence > 0 && sequence <= notice.sequence &&
        geo::GeodesicDistanceM({rows.Real(1), rows.Real(2)}, notice.position) <= notice.radius_m;
    if (could_be_told || began_anew) left_out.push_back(id);
  }
  return left_out;
}

bool LocalHazardMap::IsOfAnotherZone(const Uuid& hazard, const std::string& zone) const {
  SqliteStatement query = database_->Prepare("SELECT 1 FROM known WHERE id=? AND zone<>?");
  query.BindBlob(1, hazard.bytes.data(), hazard.bytes.size()).Bind(2, zone);
  return query.Step();
}

bool LocalHazardMap::IsNews(const protocol::Notice& notice, const std::string& zone) const {
  // One announcement says that a hazard left a cell of the map and came into the next one: so what
  // is there counts also where it was removed by the same one. No row: sequences begin at 1.
  SqliteStatement query = database_->Prepare(
      "SELECT coalesce((SELECT sequence FROM known WHERE id=?1 AND of_zone=1),0),"
      " coalesce((SELECT sequence FROM gone WHERE zone=?2 AND id=?1),0)");
  query.BindBlob(1, notice.hazard_uuid.bytes.data(), notice.hazard_uuid.bytes.size()).Bind(2, zone);
  if (!query.Step()) return true;
  const auto sequence = static_cast<std::int64_t>(notice.sequence);
  const bool is_removed = notice.action == protocol::Notice::Action::kRemoved;
  return sequence > query.Int(0) &&
         (is_removed ? sequence > query.Int(1) : sequence >= query.Int(1));
}

/// Trails as the table has them; nothing for none.
std::optional<std::string> LocalHazardMap::StoredTrails(const protocol::Notice& notice) {
  const std::string text =
      protocol::TrailsText(protocol::ValidTrails(notice.trails, notice.position));
  if (text.empty()) return std::nullopt;
  return text;
}

/// How a hazard is passed where that was not known: the same was told before by a message that does
/// not say it, or before the zone knew it.
void LocalHazardMap::LearnPasses(const protocol::Notice& notice, const std::string& zone) {
  if (notice.action == protocol::Notice::Action::kRemoved) return;
  const auto sequence = static_cast<std::int64_t>(notice.sequence);
  if (const auto trails = StoredTrails(notice)) {
    database_
        ->Prepare(
            "UPDATE known SET trails=?1 WHERE id=?2 AND of_zone=1 AND zone=?3 AND sequence=?4")
        .Bind(1, *trails)
        .BindBlob(2, notice.hazard_uuid.bytes.data(), notice.hazard_uuid.bytes.size())
        .Bind(3, zone)
        .Bind(4, sequence)
        .Execute();
  }
  if (std::isnan(notice.course_rad)) return;
  database_
      ->Prepare(
          "UPDATE known SET course_rad=?1 WHERE id=?2 AND of_zone=1 AND zone=?3 AND sequence=?4"
          " AND course_rad IS NULL")
      .Bind(1, notice.course_rad)
      .BindBlob(2, notice.hazard_uuid.bytes.data(), notice.hazard_uuid.bytes.size())
      .Bind(3, zone)
      .Bind(4, sequence)
      .Execute();
}

void LocalHazardMap::StoreNotice(const protocol::Notice& notice, const std::string& zone) {
  const auto& id = notice.hazard_uuid.bytes;
  const auto sequence = static_cast<std::int64_t>(notice.sequence);
  if (notice.action == protocol::Notice::Action::kRemoved) {
    database_->Prepare("DELETE FROM known WHERE id=?").BindBlob(1, id.data(), id.size()).Execute();
    database_->Prepare("INSERT OR REPLACE INTO gone(zone,id,sequence) VALUES(?,?,?)")
        .Bind(1, zone)
        .BindBlob(2, id.data(), id.size())
        .Bind(3, sequence)
        .Execute();
    database_
        ->Prepare(
            "DELETE FROM gone WHERE zone=?1 AND sequence <= (SELECT sequence FROM gone"
            " WHERE zone=?1 ORDER BY sequence DESC LIMIT 1 OFFSET ?2)")
        .Bind(1, zone)
        .Bind(2, std::int64_t{kGoneKept})
        .Execute();
    return;
  }
  // A message without a course or trails, as old zones and old topics have it, takes none away.
  SqliteStatement upsert = database_->Prepare(
      "INSERT OR REPLACE INTO"
      " known(id,of_zone,class_name,confidence,latitude,longitude,sequence,news_ns,zone,course_rad,"
      "  trails)"
      " VALUES(?1,1,?2,?3,?4,?5,?6,?7,?8,"
      " coalesce(?9,(SELECT course_rad FROM known WHERE id=?1 AND of_zone=1)),"
      " coalesce(?10,(SELECT trails FROM known WHERE id=?1 AND of_zone=1)))");
  upsert.BindBlob(1, id.data(), id.size())
      .Bind(2, notice.class_name)
      .Bind(3, static_cast<double>(notice.confidence))
      .Bind(4, notice.position.latitude_deg)
      .Bind(5, notice.position.longitude_deg)
      .Bind(6, sequence)
      .Bind(7, notice.stamp_ns)
      .Bind(8, zone)
      .Bind(9, notice.course_rad);  // SQLite takes NaN as NULL.
  if (const auto trails = StoredTrails(notice)) upsert.Bind(10, *trails);
  upsert.Execute();
}

}  // namespace livemap::vehicle
