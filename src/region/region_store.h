#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "common/sqlite.h"
#include "common/uuid.h"
#include "protocol/hazard_catalogue.h"
#include "region/zone_answer.h"

namespace livemap::region {

/// Where somebody stands who follows a zone's log.
struct LogPlace {
  Uuid log;                    ///< Nil: the zone has not been read to its end yet.
  std::uint64_t sequence = 0;  ///< Everything up to here is known.
  std::int64_t heard_ns = 0;   ///< When the zone answered last, UTC ns since 1970; 0: never.
  /// Names which places count: of what lies elsewhere nothing is known, also below `sequence`.
  std::string scope = {};
};

/// The last state of each zone on disk, so that a region that starts shows a zone that is down as
/// it was. One file of SQLite. Thread-safe; throws StoreError when it cannot be read or written.
class RegionStore {
 public:
  /// Opens or makes the file. A damaged one is put aside and begun anew (`damage` says so): zones
  /// that are up tell all of it again.
  RegionStore(const std::string& path, const protocol::HazardCatalogue& catalogue,
              std::int64_t now_ns);

  /// What was wrong with the file, in one sentence; empty: nothing.
  const std::string& damage() const { return damage_; }

  /// What is kept of a zone. Rows that no zone can have told are left out.
  struct Kept {
    LogPlace place;
    std::vector<ToldHazard> hazards;
  };
  Kept Load(const std::string& zone, std::int64_t now_ns) const;

  /// Keeps what a zone told, forgets those of its hazards that are in `gone` or have left the map,
  /// and where its log is followed from. All or nothing.
  void Save(const std::string& zone, const LogPlace& place, const std::vector<ToldHazard>& hazards,
            const std::vector<Uuid>& gone);

 private:
  const protocol::HazardCatalogue catalogue_;
  std::string damage_;
  mutable Mutex mutex_;
  mutable std::optional<SqliteDatabase> database_ GUARDED_BY(mutex_);
};

}  // namespace livemap::region
