#include "vehicle/alerts/cross_zone_duplicates.h"

#include <algorithm>

namespace livemap::vehicle {
namespace {

// The last word about a hazard counts, also within one set of changes.

void AddShown(const AlertHazard& hazard, CrossZoneDuplicates::Changes& changes) {
  auto& gone = changes.gone;
  gone.erase(std::remove(gone.begin(), gone.end(), hazard.id), gone.end());
  changes.put.push_back(hazard);
}

void AddGone(const Uuid& id, CrossZoneDuplicates::Changes& changes) {
  auto& put = changes.put;
  put.erase(std::remove_if(put.begin(), put.end(),
                           [&id](const AlertHazard& hazard) { return hazard.id == id; }),
            put.end());
  changes.gone.push_back(id);
}

}  // namespace

std::optional<Uuid> CrossZoneDuplicates::FindOfOtherZone(const AlertHazard& hazard,
                                                         const std::string& zone) const {
  for (const auto& [other, hazards] : shown_) {
    // A map that knows one zone only names none.
    if (other == zone || other.empty() || zone.empty()) continue;
    if (const auto match = hazards.Find(hazard.class_name, hazard.position)) return match->id;
  }
  return std::nullopt;
}

void CrossZoneDuplicates::Put(const AlertHazard& hazard, const std::string& zone,
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

void CrossZoneDuplicates::Remove(const Uuid& id, Changes& changes) {
  hidden_.erase(id);
  if (!Unshow(id)) return;
  AddGone(id, changes);
  PutThoseHiddenFor(id, changes);
}

bool CrossZoneDuplicates::Unshow(const Uuid& id) {
  const auto zone = zones_.find(id);
  if (zone == zones_.end()) return false;
  const auto hazards = shown_.find(zone->second);
  hazards->second.Remove(id);
  if (hazards->second.size() == 0) shown_.erase(hazards);
  zones_.erase(zone);
  return true;
}

/// In the order of their ids, so that the same is shown whatever the order of the table.
void CrossZoneDuplicates::PutThoseHiddenFor(const Uuid& id, Changes& changes) {
  std::vector<Hidden> again;
  for (const auto& [hidden_id, hidden] : hidden_) {
    if (hidden.shown == id) again.push_back(hidden);
  }
  std::sort(again.begin(), again.end(),
            [](const Hidden& a, const Hidden& b) { return a.hazard.id < b.hazard.id; });
  for (const Hidden& hidden : again) Put(hidden.hazard, hidden.zone, changes);
}

}  // namespace livemap::vehicle
