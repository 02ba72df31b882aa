#pragma once

#include <string>
#include <vector>

#include "protocol/hazard_catalogue.h"
#include "streets/street_place.h"
#include "web/json/json.h"
#include "zone/model/hazard.h"

namespace livemap::web {

constexpr const char* kNeighbourAddress = "/api/v1/neighbours";

/// A hazard that another zone tells its drivers of, near the border with it.
struct NeighbourHazard {
  zone::Hazard hazard;         ///< With the other zone's own id.
  streets::StreetWords words;  ///< As the other zone told them.
  std::string zone;            ///< The other zone's id.
  std::string zone_name;       ///< For people.
  std::string map_url;         ///< Of the other zone's live map.
};

/// Who knows the hazards on the other side of the zone's borders. Thread-safe.
class NeighbourReader {
 public:
  NeighbourReader() = default;
  virtual ~NeighbourReader() = default;
  NeighbourReader(const NeighbourReader&) = delete;
  NeighbourReader& operator=(const NeighbourReader&) = delete;

  /// Those that this zone does not hold, too: a hazard on the border is told by one alone. A zone
  /// that is down has its last state.
  virtual std::vector<NeighbourHazard> Hazards() const = 0;
};

/// A GeoJSON FeatureCollection (docs/reference/http-api.md). Pictures stay in the other zone.
Json NeighboursJson(const std::vector<NeighbourHazard>& hazards,
                    const protocol::HazardCatalogue& catalogue);

}  // namespace livemap::web
