#include "vehicle/alerts/announced_hazards.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <unordered_set>

#include "common/sqlite.h"

namespace livemap::vehicle {
namespace {

constexpr std::size_t kRemovedKept =
    100000;  // Beyond it all are forgotten: the map knows them, too.

/// Per axis; 0 where the covariance is none.
double SigmaOf(const Eigen::Matrix2d& covariance_m2) {
  const double sigma_m = std::sqrt(covariance_m2.trace() / 2);
  return std::isfinite(sigma_m) ? sigma_m : 0;
}

}  // namespace

std::optional<StoredHazards> ReadStoredHazards(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return std::nullopt;
  SqliteDatabase database(path, false);
  SqliteStatement tables = database.Prepare(
      "SELECT count(*) FROM sqlite_master WHERE type='table' AND name IN ('known','gone','zone')");
  if (!tables.Step() || tables.Int(0) != 3) return std::nullopt;
  tables.Reset();
  StoredHazards stored;
  database.Transaction([&] {
    SqliteStatement rows = database.Prepare(
        "SELECT id,class_name,latitude,longitude,sequence FROM known"
        " WHERE of_zone=1 AND sequence>0 AND typeof(id)='blob' AND length(id)=16");
    while (rows.Step()) {
      StoredHazards::Row row;
      const std::vector<std::uint8_t> id = rows.Blob(0);
      std::copy_n(id.begin(), row.hazard.id.bytes.size(), row.hazard.id.bytes.begin());
      row.hazard.class_name = rows.Text(1);
      row.hazard.position = {rows.Real(2), rows.Real(3)};
      row.sequence = static_cast<std::uint64_t>(rows.Int(4));
      if (geo::IsValid(row.hazard.position)) stored.rows.push_back(row);
    }
    SqliteStatement newest = database.Prepare(
        "SELECT max(sequence) FROM (SELECT sequence FROM known WHERE of_zone=1"
        " UNION ALL SELECT sequence FROM gone UNION ALL SELECT map_sequence FROM zone)");
    if (newest.Step()) stored.sequence = static_cast<std::uint64_t>(newest.Int(0));
  });
  return stored;
}

bool AnnouncedHazards::IsOld(const Uuid& id, std::uint64_t sequence) const {
  const auto there = sequences_.find(id);
  if (there != sequences_.end()) return sequence <= there->second;
  const auto gone = gone_.find(id);
  return gone != gone_.end() && sequence <= gone->second;
}

AnnouncedHazards::Changes AnnouncedHazards::Apply(const protocol::Notice& notice) {
  using Action = protocol::Notice::Action;
  Changes changes;
  // The end of a catch-up says what is gone by leaving it out: the map works that out.
  if (notice.action == Action::kCaughtUp || notice.hazard_uuid.IsNil()) return changes;
  if (!geo::IsValid(notice.position) || IsOld(notice.hazard_uuid, notice.sequence)) return changes;
  if (notice.action == Action::kRemoved) {
    if (gone_.size() >= kRemovedKept) gone_.clear();
    gone_[notice.hazard_uuid] = notice.sequence;
    if (sequences_.erase(notice.hazard_uuid) > 0) changes.gone.push_back(notice.hazard_uuid);
    return changes;
  }
  sequences_[notice.hazard_uuid] = notice.sequence;
  gone_.erase(notice.hazard_uuid);
  changes.put.push_back({notice.hazard_uuid, notice.class_name, notice.position,
                         SigmaOf(notice.covariance_m2), std::nullopt});
  return changes;
}

AnnouncedHazards::Changes AnnouncedHazards::Apply(const StoredHazards& stored) {
  Changes changes;
  // The zone began to count anew: of before, only what the map still has is there.
  const bool began_anew = stored.sequence < stored_sequence_;
  stored_sequence_ = stored.sequence;
  if (began_anew) gone_.clear();
  std::unordered_set<Uuid> in_map;
  for (const StoredHazards::Row& row : stored.rows) {
    in_map.insert(row.hazard.id);
    if (!began_anew && IsOld(row.hazard.id, row.sequence)) continue;
    sequences_[row.hazard.id] = row.sequence;
    changes.put.push_back(row.hazard);
  }
  for (auto there = sequences_.begin(); there != sequences_.end();) {
    // What is newer than all that the map has taken in will come into it yet.
    const bool gone =
        in_map.count(there->first) == 0 && (began_anew || there->second <= stored.sequence);
    if (gone) changes.gone.push_back(there->first);
    there = gone ? sequences_.erase(there) : std::next(there);
  }
  std::sort(changes.gone.begin(), changes.gone.end());
  return changes;
}

}  // namespace livemap::vehicle
