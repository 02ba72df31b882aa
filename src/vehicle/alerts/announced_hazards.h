#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/uuid.h"
#include "protocol/cross_zone_duplicates.h"
#include "protocol/hazard_catalogue.h"
#include "protocol/notice.h"
#include "vehicle/alerts/driver_alerts.h"

namespace livemap::vehicle {

/// What stands in a vehicle's local hazard map of the zone's announcements.
struct StoredHazards {
  struct Row {
    AlertHazard hazard;
    std::uint64_t sequence = 0;  ///< Of the newest announcement about it.
    std::string zone;            ///< Id of the zone that announced it.
  };
  std::vector<Row> rows;
  /// The highest sequence of each zone that the map has taken in, by the zone's id.
  std::map<std::string, std::uint64_t> sequences;
};

/// Reads the database of a LocalHazardMap, which another object may have open and write to. The
/// vehicle's own reports that the zone has not announced are not for drivers and left out, and so
/// are rows of impossible values. Nothing where there is no file or no table yet. Throws StoreError
/// when it cannot be read.
std::optional<StoredHazards> ReadStoredHazards(const std::string& path);

/// The hazards that zones have announced: by their notices as they come, and by the vehicle's local
/// map, which knows what came before the start and is told again what was missed. The newer word
/// of the hazard's zone counts, by its sequence; another zone's word about it does not. What two
/// zones announce at one place is there for the driver once (protocol::CrossZoneDuplicates). Not
/// thread-safe.
class AnnouncedHazards {
 public:
  /// What changes for the driver.
  using Changes = protocol::CrossZoneDuplicates<AlertHazard>::Changes;

  /// `catalogue` says how near two hazards of a class are one.
  explicit AnnouncedHazards(protocol::HazardCatalogue catalogue = {})
      : duplicates_(std::move(catalogue)) {}

  /// Whether a place is none of a zone's business (ZoneFinder::is_beyond): a notice that something
  /// is there is left out and counted.
  void RefuseBeyond(std::function<bool(const std::string&, const geo::GeoPoint&)> is_beyond) {
    is_beyond_ = std::move(is_beyond);
  }
  Changes Apply(const protocol::Notice& notice);
  Changes Apply(const StoredHazards& stored);
  std::size_t size() const { return there_.size(); }
  /// Notices that were left out for RefuseBeyond.
  std::uint64_t beyond_zone() const { return beyond_zone_; }
  /// Of size(), those that the driver is not told of, because another zone announces them, too.
  std::size_t hidden() const { return duplicates_.hidden(); }

 private:
  /// The newest word about a hazard.
  struct Word {
    std::string zone;
    std::uint64_t sequence = 0;
    double course_rad = std::numeric_limits<double>::quiet_NaN();  ///< AlertHazard::course_rad.
    std::vector<protocol::Trail> trails{};                         ///< AlertHazard::trails.
  };

  bool IsOld(const Uuid& id, const Word& word, bool is_there) const;
  void Take(AlertHazard hazard, Word word, Changes& changes);
  std::set<std::string> ZonesBegunAnew(const StoredHazards& stored) const;

  std::unordered_map<Uuid, Word> there_;
  std::unordered_map<Uuid, Word> gone_;  // Removed since the start.
  std::map<std::string, std::uint64_t> stored_sequences_;
  protocol::CrossZoneDuplicates<AlertHazard> duplicates_;
  std::function<bool(const std::string&, const geo::GeoPoint&)> is_beyond_;  // May be empty.
  std::uint64_t beyond_zone_ = 0;
};

}  // namespace livemap::vehicle
