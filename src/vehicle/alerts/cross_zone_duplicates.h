#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/uuid.h"
#include "protocol/hazard_catalogue.h"
#include "vehicle/alerts/driver_alerts.h"
#include "vehicle/reporting/duplicate_filter.h"

namespace livemap::vehicle {

/// Shows a hazard once that two zones announce, because vehicles have placed it on both sides of
/// their border: hazards of one class within the class's duplicate radius are one where different
/// zones announce them. The first one that came is shown until it is gone or has moved away; then
/// another one takes its place. Hazards of one zone are never taken for one another: that zone has
/// decided so. Not thread-safe.
class CrossZoneDuplicates {
 public:
  /// What changes in what is shown; no hazard is in both.
  struct Changes {
    std::vector<AlertHazard> put;
    std::vector<Uuid> gone;
  };

  explicit CrossZoneDuplicates(protocol::HazardCatalogue catalogue)
      : catalogue_(std::move(catalogue)) {}

  /// A hazard of the zone with this id is new, or has changed. Its position is valid. An empty id
  /// is no other zone.
  void Put(const AlertHazard& hazard, const std::string& zone, Changes& changes);
  /// A hazard is gone; one that is not known changes nothing.
  void Remove(const Uuid& id, Changes& changes);

  /// Hazards that are not shown for another zone's sake.
  std::size_t hidden() const { return hidden_.size(); }

 private:
  struct Hidden {
    AlertHazard hazard;
    std::string zone;
    Uuid shown;  // In its place.
  };

  std::optional<Uuid> FindOfOtherZone(const AlertHazard& hazard, const std::string& zone) const;
  bool Unshow(const Uuid& id);
  void PutThoseHiddenFor(const Uuid& id, Changes& changes);

  protocol::HazardCatalogue catalogue_;
  std::map<std::string, DuplicateFilter> shown_;  // By zone.
  std::unordered_map<Uuid, std::string> zones_;   // Of those that are shown.
  std::unordered_map<Uuid, Hidden> hidden_;
};

}  // namespace livemap::vehicle
