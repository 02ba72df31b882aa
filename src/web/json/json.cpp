#include "web/json/json.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "common/utc_text.h"

namespace livemap::web {
namespace {

Json Coordinates(const geo::GeoPoint& position) {
  return Json::array({Rounded(position.longitude_deg, 7), Rounded(position.latitude_deg, 7)});
}

Json ImageUrl(const zone::Hazard& hazard) {
  if (hazard.image_sha256.empty()) return nullptr;
  return "/images/" + hazard.image_sha256;
}

Json TextOrNull(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

/// What is not known is null, and `street_note` says why.
void AddStreet(const streets::StreetWords& words, Json& properties) {
  properties["street"] = TextOrNull(words.street);
  properties["near"] = TextOrNull(words.near);
  properties["direction"] = TextOrNull(words.direction);
  properties["street_note"] = TextOrNull(words.note);
}

}  // namespace

double Rounded(double value, int digits) {
  const double scale = std::pow(10.0, digits);
  return std::round(value * scale) / scale;
}

Json PointFeature(const std::string& id, const geo::GeoPoint& position) {
  Json feature;
  feature["type"] = "Feature";
  feature["id"] = id;
  feature["geometry"] = {{"type", "Point"}, {"coordinates", Coordinates(position)}};
  return feature;
}

Json PositionSigma(const Eigen::Matrix2d& covariance_m2) {
  if (!covariance_m2.allFinite()) return nullptr;
  const double largest =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance_m2, Eigen::EigenvaluesOnly)
          .eigenvalues()
          .maxCoeff();
  if (!(largest > 0)) return nullptr;
  return Rounded(std::sqrt(largest), 2);
}

std::string ToText(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

const char* ActionName(zone::HazardAction action) {
  switch (action) {
    case zone::HazardAction::kAdded:
      return "added";
    case zone::HazardAction::kUpdated:
      return "updated";
    case zone::HazardAction::kRemoved:
      return "removed";
  }
  return "updated";
}

zone::HazardAction ReplayAction(const zone::Hazard& hazard) {
  if (!zone::IsOnMap(hazard.state)) return zone::HazardAction::kRemoved;
  // A hazard's first event leaves it with one sighting; every later event is an update.
  return hazard.sightings <= 1 ? zone::HazardAction::kAdded : zone::HazardAction::kUpdated;
}

Json HazardFeature(const zone::Hazard& hazard, const protocol::HazardCatalogue& catalogue,
                   const streets::StreetWords& words) {
  Json feature = PointFeature(hazard.uuid.ToString(), hazard.position);
  Json& properties = feature["properties"];
  properties["id"] = hazard.uuid.ToString();
  properties["class"] = hazard.class_name;
  properties["label"] = catalogue.Get(hazard.class_name).label;
  properties["confidence"] = Rounded(static_cast<double>(hazard.confidence), 4);
  properties["sightings"] = hazard.sightings;
  properties["state"] = zone::HazardStateName(hazard.state);
  properties["presence"] = Rounded(static_cast<double>(hazard.presence), 4);
  properties["vehicles"] = hazard.vehicles;
  properties["first_seen"] = Rfc3339(hazard.first_seen_ns);
  properties["last_seen"] = Rfc3339(hazard.last_seen_ns);
  properties["updated"] = Rfc3339(hazard.updated_ns);
  properties["position_sigma_m"] = PositionSigma(hazard.covariance_m2);
  AddStreet(words, properties);
  properties["image"] = ImageUrl(hazard);
  properties["sequence"] = hazard.sequence;
  return feature;
}

Json EventJson(const zone::StoredEvent& event) {
  Json json;
  json["sequence"] = event.sequence;
  json["action"] = ActionName(event.action);
  json["from"] = event.from ? Json(zone::HazardStateName(*event.from)) : Json(nullptr);
  json["to"] = zone::HazardStateName(event.to);
  json["reason"] = event.reason;
  json["time"] = Rfc3339(event.at_ns);
  return json;
}

Json HazardMessage(zone::HazardAction action, const zone::Hazard& hazard,
                   const protocol::HazardCatalogue& catalogue, const streets::StreetWords& words) {
  Json message;
  message["type"] = "hazard";
  message["action"] = ActionName(action);
  message["sequence"] = hazard.sequence;
  message["feature"] = HazardFeature(hazard, catalogue, words);
  return message;
}

Json VehicleFeature(const zone::VehicleState& vehicle, const TrailPositions& trail) {
  Json feature = PointFeature(vehicle.vehicle_id, vehicle.position);
  Json& properties = feature["properties"];
  properties["vehicle"] = vehicle.vehicle_id;
  properties["drive"] = vehicle.drive_id;
  // JSON knows no NaN: an unknown course or speed is null.
  properties["course_rad"] = Rounded(vehicle.course_rad, 4);
  properties["speed_mps"] = Rounded(vehicle.speed_mps, 2);
  properties["time"] = Rfc3339(vehicle.stamp_ns);
  properties["heard"] = Rfc3339(vehicle.heard_ns);
  if (trail.empty()) return feature;
  Json& positions = properties["trail"] = Json::array();
  for (const auto& [longitude, latitude] : trail) {
    positions.push_back(Json::array({Rounded(longitude, 7), Rounded(latitude, 7)}));
  }
  return feature;
}

Json VehicleMessage(const zone::VehicleState& vehicle) {
  Json message;
  message["type"] = "vehicle";
  message["feature"] = VehicleFeature(vehicle, {});
  return message;
}

Json ClassesJson(const protocol::HazardCatalogue& catalogue) {
  Json classes = Json::array();
  for (const auto& [name, hazard_class] : catalogue.classes()) {
    classes.push_back({{"class", name},
                       {"label", hazard_class.label},
                       {"icon", hazard_class.icon},
                       {"colour", hazard_class.colour}});
  }
  const protocol::HazardClass fallback = catalogue.Get("");
  Json answer;
  answer["classes"] = std::move(classes);
  answer["default"] = {{"icon", fallback.icon}, {"colour", fallback.colour}};
  return answer;
}

}  // namespace livemap::web
