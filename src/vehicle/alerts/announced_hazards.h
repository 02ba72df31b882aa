#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/uuid.h"
#include "protocol/notice.h"
#include "vehicle/alerts/driver_alerts.h"

namespace livemap::vehicle {

/// What stands in a vehicle's local hazard map of the zone's announcements.
struct StoredHazards {
  struct Row {
    AlertHazard hazard;
    std::uint64_t sequence = 0;  ///< Of the newest announcement about it.
  };
  std::vector<Row> rows;
  /// The highest sequence that the map has taken in.
  std::uint64_t sequence = 0;
};

/// Reads the database of a LocalHazardMap, which another object may have open and write to. The
/// vehicle's own reports that the zone has not announced are not for drivers and left out, and so
/// are rows of impossible values. Nothing where there is no file or no table yet. Throws StoreError
/// when it cannot be read.
std::optional<StoredHazards> ReadStoredHazards(const std::string& path);

/// The hazards that the zone has announced: by its notices as they come, and by the vehicle's local
/// map, which knows what came before the start and is told again what was missed. The newer word
/// counts, by its sequence. Not thread-safe.
class AnnouncedHazards {
 public:
  /// What changes for the driver.
  struct Changes {
    std::vector<AlertHazard> put;
    std::vector<Uuid> gone;
  };

  Changes Apply(const protocol::Notice& notice);
  Changes Apply(const StoredHazards& stored);
  std::size_t size() const { return sequences_.size(); }

 private:
  bool IsOld(const Uuid& id, std::uint64_t sequence) const;

  std::unordered_map<Uuid, std::uint64_t> sequences_;  // Of what is there.
  std::unordered_map<Uuid, std::uint64_t> gone_;       // Of what was removed since the start.
  std::uint64_t stored_sequence_ = 0;
};

}  // namespace livemap::vehicle
