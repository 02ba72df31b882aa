#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/uuid.h"
#include "protocol/duplicate_filter.h"
#include "protocol/hazard_catalogue.h"

namespace livemap::protocol {

/// Shows a hazard once that two zones announce, because vehicles have placed it on both sides of
/// their border: hazards of one class within the class's duplicate radius are one where different
/// zones announce them. The first one that came is shown until it is gone or has moved away; then
/// another one takes its place. Hazards of one zone are never taken for one another: that zone has
/// decided so. `Hazard` has an `id`, a `class_name` and a `position`. Not thread-safe.
template <typename Hazard>
class CrossZoneDuplicates {
 public:
  /// What changes in what is shown; no hazard is in both.
  struct Changes {
    std::vector<Hazard> put;
    std::vector<Uuid> gone;
  };

  explicit CrossZoneDuplicates(HazardCatalogue catalogue) : catalogue_(std::move(catalogue)) {}

  /// A hazard of the zone with this id is new, or has changed. Its position is valid. An empty id
  /// is no other zone.
  void Put(const Hazard& hazard, const std::string& zone, Changes& changes);
  /// A hazard is gone; one that is not known changes nothing.
  void Remove(const Uuid& id, Changes& changes);

  /// Hazards that are not shown for another zone's sake.
  std::size_t hidden() const { return hidden_.size(); }

 private:
  struct Hidden {
    Hazard hazard;
    std::string zone;
    Uuid shown;  // In its place.
  };

  // The last word about a hazard counts, also within one set of changes.
  static void AddShown(const Hazard& hazard, Changes& changes);
  static void AddGone(const Uuid& id, Changes& changes);
  std::optional<Uuid> FindOfOtherZone(const Hazard& hazard, const std::string& zone) const;
  bool Unshow(const Uuid& id);
  void PutThoseHiddenFor(const Uuid& id, Changes& changes);

  HazardCatalogue catalogue_;
  std::map<std::string, DuplicateFilter> shown_;  // By zone.
  std::unordered_map<Uuid, std::string> zones_;   // Of those that are shown.
  std::unordered_map<Uuid, Hidden> hidden_;
};

template <typename Hazard>
void CrossZoneDuplicates<Hazard>::AddShown(const Hazard& hazard, Changes& changes) {
  auto& gone = changes.gone;
  gone.erase(std::remove(gone.begin(), gone.end(), hazard.id), gone.end());
  changes.put.push_back(hazard);
}

template <typename Hazard>
void CrossZoneDuplicates<Hazard>::AddGone(const Uuid& id, Changes& changes) {
  auto& put = changes.put;
  put.erase(std::remove_if(put.begin(), put.end(),
                           [&id](const Hazard& hazard) { return hazard.id == id; }),
            put.end());
  changes.gone.push_back(id);
}

template <typename Hazard>
std::optional<Uuid> CrossZoneDuplicates<Hazard>::FindOfOtherZone(const Hazard& hazard,
                                                                 const std::string& zone) const {
  for (const auto& [other, hazards] : shown_) {
    // A map that knows one zone only names none.
    if (other == zone || other.empty() || zone.empty()) continue;
    if (const auto match = hazards.Find(hazard.class_name, hazard.position)) return match->id;
  }
  return std::nullopt;
}

template <typename Hazard>
void CrossZoneDuplicates<Hazard>::Put(const Hazard& hazard, const std::string& zone,
                                      Changes& changes) {
  hidden_.erase(hazard.id);
  const bool was_shown = Unshow(hazard.id);
  if (const auto shown = FindOfOtherZone(hazard, zone)) {
    hidden_[hazard.id] = {hazard, zone, *shown};
    if (was_shown) AddGone(hazard.id, changes);
  } else {
    shown_.try_emplace(zone, catalogue_)
        .first->second.Put(hazard.id, hazard.class_name, hazard.position);
    zones_[hazard.id] = zone;
    AddShown(hazard, changes);
  }
  // It may have moved away from them, or is hidden itself.
  if (was_shown) PutThoseHiddenFor(hazard.id, changes);
}

template <typename Hazard>
void CrossZoneDuplicates<Hazard>::Remove(const Uuid& id, Changes& changes) {
  hidden_.erase(id);
  if (!Unshow(id)) return;
  AddGone(id, changes);
  PutThoseHiddenFor(id, changes);
}

template <typename Hazard>
bool CrossZoneDuplicates<Hazard>::Unshow(const Uuid& id) {
  const auto zone = zones_.find(id);
  if (zone == zones_.end()) return false;
  const auto hazards = shown_.find(zone->second);
  hazards->second.Remove(id);
  if (hazards->second.size() == 0) shown_.erase(hazards);
  zones_.erase(zone);
  return true;
}

/// In the order of their ids, so that the same is shown whatever the order of the table.
template <typename Hazard>
void CrossZoneDuplicates<Hazard>::PutThoseHiddenFor(const Uuid& id, Changes& changes) {
  std::vector<Hidden> again;
  for (const auto& [hidden_id, hidden] : hidden_) {
    if (hidden.shown == id) again.push_back(hidden);
  }
  std::sort(again.begin(), again.end(),
            [](const Hidden& a, const Hidden& b) { return a.hazard.id < b.hazard.id; });
  for (const Hidden& hidden : again) Put(hidden.hazard, hidden.zone, changes);
}

}  // namespace livemap::protocol
