#include "web/api/neighbour_api.h"

#include <utility>

namespace livemap::web {

Json NeighboursJson(const std::vector<NeighbourHazard>& hazards,
                    const protocol::HazardCatalogue& catalogue) {
  Json features = Json::array();
  for (const NeighbourHazard& neighbour : hazards) {
    Json feature = HazardFeature(neighbour.hazard, catalogue, neighbour.words);
    Json& properties = feature["properties"];
    properties["image"] = nullptr;
    properties["zone"] = neighbour.zone;
    properties["zone_name"] = neighbour.zone_name;
    properties["map"] = neighbour.map_url + "/";
    features.push_back(std::move(feature));
  }
  return {{"type", "FeatureCollection"}, {"features", std::move(features)}};
}

}  // namespace livemap::web
