#include "change/memory/place_memory.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/error.h"

namespace livemap::change {
namespace {

constexpr double kMetresPerDegree = 111319.49;  // Of latitude; cells need no more than that.
constexpr double kNsPerDay = 86400e9;
constexpr double kTurn = 6.283185307179586;

std::vector<std::string> PlaceMemoryMigrations() {
  return {
      "CREATE TABLE frames("
      "  id INTEGER PRIMARY KEY AUTOINCREMENT,"
      "  sha256 TEXT NOT NULL UNIQUE,"
      "  drive_id TEXT NOT NULL,"
      "  stamp_ns INTEGER NOT NULL,"
      "  latitude REAL NOT NULL, longitude REAL NOT NULL,"
      "  heading REAL NOT NULL,"
      "  quality REAL NOT NULL,"
      "  bytes INTEGER NOT NULL,"
      "  cell INTEGER NOT NULL);"
      "CREATE INDEX frames_by_cell ON frames(cell);"
      "CREATE INDEX frames_by_stamp ON frames(stamp_ns);"
      // 0 until the files that were there before the index have been read.
      "CREATE TABLE state(complete INTEGER NOT NULL);"
      "INSERT INTO state VALUES(0);"};
}

void CheckMemoryLimit(double value, double least, double most, const char* name) {
  if (value >= least && value <= most) return;
  throw Error("place memory's " + std::string(name) + " is " + std::to_string(value) +
              ", accepted is " + std::to_string(least) + " to " + std::to_string(most));
}

PlaceMemory::Config CheckedMemoryConfig(const PlaceMemory::Config& config) {
  CheckMemoryLimit(config.cell_m, 2, 1000, "cell_m");
  CheckMemoryLimit(config.heading_sectors, 1, 64, "heading_sectors");
  CheckMemoryLimit(config.max_cell_bytes, 1e4, 1e12, "max_cell_bytes");
  CheckMemoryLimit(config.half_life_days, 0.001, 1e6, "half_life_days");
  CheckMemoryLimit(config.max_bytes, config.max_cell_bytes, 1e15, "max_bytes");
  CheckMemoryLimit(static_cast<double>(config.reach.candidates), 1, 1000, "candidates");
  CheckMemoryLimit(config.reach.max_distance_m, 0.1, 1000, "max_distance_m");
  CheckMemoryLimit(config.reach.max_heading_difference_rad, 0, kTurn / 2,
                   "max_heading_difference_rad");
  CheckMemoryLimit(config.match_ratio, 0.1, 1, "match_ratio");
  CheckMemoryLimit(config.max_cached_bytes, 0, 1e12, "max_cached_bytes");
  return config;
}

}  // namespace

PlaceMemory::PlaceMemory(const Config& config, std::int64_t now_ns)
    : config_(CheckedMemoryConfig(config)), files_(config_.directory), index_(config_.reach) {
  try {
    Open();
  } catch (const StoreError& error) {
    if (!IsCorruption(error)) throw;
    database_.reset();
    recovery_.set_aside = QuarantineDatabase(IndexPath(), now_ns);
    Open();
  }
  SqliteStatement state = database_->Prepare("SELECT complete FROM state");
  const bool complete = state.Step() && state.Int(0) != 0;
  state.Reset();
  if (!complete) {
    Rebuild();
    LoadIndex();
  }
  Reconcile();
}

void PlaceMemory::Open() {
  database_ = std::make_unique<SqliteDatabase>(IndexPath(), /*durable=*/true);
  database_->CheckPages();
  database_->Migrate(PlaceMemoryMigrations());
  LoadIndex();
}

void PlaceMemory::Rebuild() {
  database_->Transaction([&] {
    database_->Execute("DELETE FROM frames");
    for (const std::string& sha256 : files_.List()) {
      try {
        const std::string bytes = files_.Read(sha256);
        InsertRow(ParsePlaceRecord(bytes, sha256), sha256, bytes.size());
        ++recovery_.rebuilt;
      } catch (const StoreError&) {
        throw;
      } catch (const Error&) {
        files_.SetAside(sha256);
        ++recovery_.unreadable;
      }
    }
    database_->Execute("UPDATE state SET complete=1");
  });
}

void PlaceMemory::LoadIndex() {
  index_ = PlaceIndex(config_.reach);
  entries_.clear();
  bytes_ = 0;
  SqliteStatement rows =
      database_->Prepare("SELECT id,sha256,drive_id,latitude,longitude,heading,bytes FROM frames");
  while (rows.Step()) {
    PlaceFrame frame;
    frame.drive_id = rows.Text(2);
    frame.position = {rows.Real(3), rows.Real(4)};
    frame.heading_rad = rows.Real(5);
    const std::int64_t bytes = rows.Int(6);
    const bool sound = geo::IsValid(frame.position) && frame.heading_rad >= 0 &&
                       frame.heading_rad < kTurn && rows.Text(1).size() == 64 && bytes > 0 &&
                       bytes <= static_cast<std::int64_t>(kMaxRecordBytes);
    if (!sound) {
      throw StoreError("place memory '" + IndexPath() + "' is malformed: row " +
                       std::to_string(rows.Int(0)) + " holds no frame");
    }
    Show(rows.Int(0), frame, rows.Text(1), static_cast<std::size_t>(bytes));
  }
}

void PlaceMemory::Reconcile() {
  const std::vector<std::string> files = files_.List();
  std::vector<bool> known(files.size(), false);
  std::vector<std::int64_t> lost;
  for (const auto& [id, entry] : entries_) {
    const auto found = std::lower_bound(files.begin(), files.end(), entry.sha256);
    if (found == files.end() || *found != entry.sha256) {
      lost.push_back(id);
    } else {
      known[static_cast<std::size_t>(found - files.begin())] = true;
    }
  }
  if (!lost.empty()) {
    database_->Transaction([&] { DeleteRows(lost); });
    for (const std::int64_t id : lost) Hide(id);
    recovery_.lost_files = lost.size();
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (known[i]) continue;
    files_.Remove(files[i]);
    ++recovery_.orphan_files;
  }
}

std::int64_t PlaceMemory::CellOf(const PlaceFrame& frame) const {
  const auto row = static_cast<std::int64_t>(
      std::floor((frame.position.latitude_deg + 90) * kMetresPerDegree / config_.cell_m));
  // A row's width is that of its lower edge, so that a cell does not depend on who is in it.
  const double latitude_deg = static_cast<double>(row) * config_.cell_m / kMetresPerDegree - 90;
  const double metres_per_degree =
      kMetresPerDegree * std::max(0.0, std::cos(latitude_deg * geo::kRadiansPerDegree));
  const auto column = static_cast<std::int64_t>(
      std::floor((frame.position.longitude_deg + 180) * metres_per_degree / config_.cell_m));
  const auto sector = std::min<std::int64_t>(
      static_cast<std::int64_t>(frame.heading_rad / kTurn * config_.heading_sectors),
      config_.heading_sectors - 1);
  return (row << 36) | (column << 7) | sector;
}

std::int64_t PlaceMemory::InsertRow(const PlaceRecord& record, const std::string& sha256,
                                    std::size_t bytes) {
  const PlaceFrame& frame = record.frame;
  SqliteStatement insert = database_->Prepare(
      "INSERT INTO frames(sha256,drive_id,stamp_ns,latitude,longitude,heading,quality,bytes,cell)"
      " VALUES(?,?,?,?,?,?,?,?,?) RETURNING id");
  insert.Bind(1, sha256)
      .Bind(2, frame.drive_id)
      .Bind(3, frame.stamp_ns)
      .Bind(4, frame.position.latitude_deg)
      .Bind(5, frame.position.longitude_deg)
      .Bind(6, frame.heading_rad)
      .Bind(7, PlaceQuality(frame, record.features))
      .Bind(8, static_cast<std::int64_t>(bytes))
      .Bind(9, CellOf(frame));
  insert.Step();
  const std::int64_t id = insert.Int(0);
  while (insert.Step()) {
  }
  return id;
}

std::vector<std::int64_t> PlaceMemory::CellVictims(std::int64_t cell) {
  struct Frame {
    std::int64_t id;
    std::int64_t stamp_ns;
    double quality;
    double bytes;
    double worth;
  };
  std::vector<Frame> frames;
  SqliteStatement rows =
      database_->Prepare("SELECT id,stamp_ns,quality,bytes FROM frames WHERE cell=?");
  rows.Bind(1, cell);
  double total = 0;
  while (rows.Step()) {
    frames.push_back({rows.Int(0), rows.Int(1), rows.Real(2), static_cast<double>(rows.Int(3)), 0});
    total += frames.back().bytes;
  }
  std::vector<std::int64_t> victims;
  if (total <= config_.max_cell_bytes) return victims;
  const auto newest = std::max_element(frames.begin(), frames.end(), [](auto& a, auto& b) {
    return std::pair(a.stamp_ns, a.id) < std::pair(b.stamp_ns, b.id);
  });
  const std::int64_t newest_id = newest->id;
  const auto newest_ns = static_cast<double>(newest->stamp_ns);
  for (Frame& frame : frames) {
    const double age_days = (newest_ns - static_cast<double>(frame.stamp_ns)) / kNsPerDay;
    frame.worth = frame.quality * std::exp2(-age_days / config_.half_life_days);
  }
  std::sort(frames.begin(), frames.end(), [](const Frame& a, const Frame& b) {
    return std::pair(a.worth, a.id) < std::pair(b.worth, b.id);
  });
  for (const Frame& frame : frames) {
    if (total <= config_.max_cell_bytes) break;
    if (frame.id == newest_id) continue;
    victims.push_back(frame.id);
    total -= frame.bytes;
  }
  return victims;
}

std::vector<std::int64_t> PlaceMemory::OverallVictims(double excess_bytes, std::int64_t added) {
  std::vector<std::int64_t> victims;
  if (excess_bytes <= 0) return victims;
  SqliteStatement rows = database_->Prepare("SELECT id,bytes FROM frames ORDER BY stamp_ns,id");
  while (excess_bytes > 0 && rows.Step()) {
    if (rows.Int(0) == added) continue;
    victims.push_back(rows.Int(0));
    excess_bytes -= static_cast<double>(rows.Int(1));
  }
  return victims;
}

void PlaceMemory::DeleteRows(const std::vector<std::int64_t>& ids) {
  SqliteStatement remove = database_->Prepare("DELETE FROM frames WHERE id=?");
  for (const std::int64_t id : ids) remove.Bind(1, id).Execute();
}

std::optional<std::int64_t> PlaceMemory::Add(const PlaceRecord& record) {
  const std::string bytes = SerialisePlaceRecord(record);
  const auto size = static_cast<double>(bytes.size());
  if (size > config_.max_cell_bytes) {
    throw Error("a frame to remember has " + std::to_string(bytes.size()) +
                " bytes, accepted is what a cell may hold, " +
                std::to_string(static_cast<std::int64_t>(config_.max_cell_bytes)));
  }
  const std::string sha256 = files_.Put(bytes);
  {
    SqliteStatement same = database_->Prepare("SELECT id FROM frames WHERE sha256=?");
    same.Bind(1, sha256);
    if (same.Step()) return same.Int(0);
  }
  std::int64_t id = 0;
  std::vector<std::int64_t> victims;
  try {
    database_->Transaction([&] {
      id = InsertRow(record, sha256, bytes.size());
      victims = CellVictims(CellOf(record.frame));
      DeleteRows(victims);
      double freed = 0;
      for (const std::int64_t victim : victims) {
        freed += victim == id ? size : static_cast<double>(entries_.at(victim).bytes);
      }
      const std::vector<std::int64_t> more =
          OverallVictims(bytes_ + size - freed - config_.max_bytes, id);
      DeleteRows(more);
      victims.insert(victims.end(), more.begin(), more.end());
    });
  } catch (...) {
    files_.Remove(sha256);
    throw;
  }
  Show(id, record.frame, sha256, bytes.size());
  bool stays = true;
  for (const std::int64_t victim : victims) {
    files_.Remove(entries_.at(victim).sha256);
    Hide(victim);
    stays = stays && victim != id;
  }
  if (!stays) return std::nullopt;
  return id;
}

void PlaceMemory::Show(std::int64_t id, const PlaceFrame& frame, const std::string& sha256,
                       std::size_t bytes) {
  index_.Insert(id, frame.position, frame.heading_rad, frame.drive_id);
  entries_[id] = {static_cast<std::uint32_t>(bytes), sha256};
  bytes_ += static_cast<double>(bytes);
}

void PlaceMemory::Hide(std::int64_t id) {
  const auto found = entries_.find(id);
  index_.Erase(id);
  bytes_ -= found->second.bytes;
  entries_.erase(found);
  Uncache(id);
}

std::vector<PlaceMemory::Ranked> PlaceMemory::Rank(const ImageFeatures& features,
                                                   const std::vector<PlaceMatch>& candidates) {
  std::vector<Ranked> ranked;
  for (const PlaceMatch& candidate : candidates) {
    const auto remembered = Features(candidate.id);
    if (remembered == nullptr) continue;
    ranked.push_back({candidate, MatchFeatures(*remembered, features, config_.match_ratio).size()});
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const Ranked& a, const Ranked& b) { return a.matches > b.matches; });
  return ranked;
}

std::optional<PlaceRecord> PlaceMemory::Load(std::int64_t id) {
  const auto found = entries_.find(id);
  if (found == entries_.end()) return std::nullopt;
  try {
    const std::string& sha256 = found->second.sha256;
    return ParsePlaceRecord(files_.Read(sha256), sha256);
  } catch (const Error&) {
    DropDamaged(id);
    return std::nullopt;
  }
}

void PlaceMemory::DropDamaged(std::int64_t id) {
  database_->Transaction([&] { DeleteRows({id}); });
  files_.SetAside(entries_.at(id).sha256);
  Hide(id);
  ++damaged_;
}

std::shared_ptr<const ImageFeatures> PlaceMemory::Features(std::int64_t id) {
  const auto cached = cached_.find(id);
  if (cached != cached_.end()) {
    cache_.splice(cache_.begin(), cache_, cached->second);
    return cached->second->features;
  }
  std::optional<PlaceRecord> record = Load(id);
  if (!record) return nullptr;
  auto features = std::make_shared<const ImageFeatures>(std::move(record->features));
  Cache(id, features);
  return features;
}

void PlaceMemory::Cache(std::int64_t id, std::shared_ptr<const ImageFeatures> features) {
  cached_bytes_ += static_cast<double>(features->Bytes());
  cache_.push_front({id, std::move(features)});
  cached_[id] = cache_.begin();
  while (cached_bytes_ > config_.max_cached_bytes && !cache_.empty()) Uncache(cache_.back().id);
}

void PlaceMemory::Uncache(std::int64_t id) {
  const auto found = cached_.find(id);
  if (found == cached_.end()) return;
  cached_bytes_ -= static_cast<double>(found->second->features->Bytes());
  cache_.erase(found->second);
  cached_.erase(found);
}

}  // namespace livemap::change
