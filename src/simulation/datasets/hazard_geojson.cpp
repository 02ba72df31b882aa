#include "simulation/datasets/hazard_geojson.h"

#include <nlohmann/json.hpp>

namespace livemap::simulation {

std::string HazardsAsGeoJson(const Street& street, const geo::GeoPoint& datum,
                             const std::map<std::uint32_t, int>& frames_seen, double end_along_m) {
  const geo::LocalFrame frame(datum);
  nlohmann::json features = nlohmann::json::array();
  const auto last = static_cast<int>(street.line().length_m() / kBlockM) + 1;
  for (int index = 0; index <= last; ++index) {
    for (const StreetHazard& hazard : street.Hazards(index)) {
      const auto seen = frames_seen.find(hazard.instance);
      if (seen == frames_seen.end()) continue;
      const Eigen::Vector3d place = street.line().At(hazard.along_m, hazard.left_m, 0);
      const geo::GeoPoint position = frame.ToGeo(place.head<2>());
      features.push_back(
          {{"type", "Feature"},
           {"geometry",
            {{"type", "Point"}, {"coordinates", {position.longitude_deg, position.latitude_deg}}}},
           {"properties",
            {{"id", hazard.instance},
             {"class", ClassName(hazard.object_class)},
             {"along_m", hazard.along_m},
             {"left_m", hazard.left_m},
             {"radius_m", hazard.radius_m},
             {"frames_seen", seen->second},
             {"passed", hazard.along_m < end_along_m}}}});
    }
  }
  return nlohmann::json({{"type", "FeatureCollection"}, {"features", features}}).dump(1) + "\n";
}

}  // namespace livemap::simulation
