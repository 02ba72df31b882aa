#include "web/json/map_change_json.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>

#include "common/utc_text.h"
#include "protocol/change_class.h"

namespace livemap::web {
namespace {

/// "Traffic cone" of "traffic_cone".
std::string LabelOf(std::string class_name) {
  std::replace(class_name.begin(), class_name.end(), '_', ' ');
  if (!class_name.empty()) {
    class_name[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(class_name[0])));
  }
  return class_name;
}

/// "#rrggbb", as the masks of changes are painted.
std::string ColourOf(const std::string& class_name) {
  protocol::ChangeClass change_class = protocol::ChangeClass::kOtherObjects;
  for (int i = 1; i < protocol::kChangeClasses; ++i) {
    if (class_name == protocol::ChangeClassName(static_cast<protocol::ChangeClass>(i))) {
      change_class = static_cast<protocol::ChangeClass>(i);
    }
  }
  const auto rgb = protocol::ChangeClassColour(change_class);
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "#%02x%02x%02x", unsigned{rgb[0]}, unsigned{rgb[1]},
                unsigned{rgb[2]});
  return text.data();
}

}  // namespace

zone::HazardAction ReplayAction(const zone::MapChangeFeature& feature) {
  if (!zone::IsOpen(feature.state)) return zone::HazardAction::kRemoved;
  return feature.reports <= 1 ? zone::HazardAction::kAdded : zone::HazardAction::kUpdated;
}

Json MapChangeGeoJson(const zone::MapChangeFeature& feature) {
  Json json = PointFeature(feature.uuid.ToString(), feature.position);
  Json& properties = json["properties"];
  properties["id"] = feature.uuid.ToString();
  properties["class"] = feature.class_name;
  properties["label"] = LabelOf(feature.class_name);
  properties["colour"] = ColourOf(feature.class_name);
  properties["direction"] = feature.vanished ? "vanished" : "appeared";
  properties["state"] = zone::MapChangeStateName(feature.state);
  properties["confidence"] = Rounded(static_cast<double>(feature.confidence), 4);
  properties["vehicles"] = feature.Vehicles();
  properties["drives"] = feature.drives;
  properties["reports"] = feature.reports;
  properties["against"] = feature.Vehicles(true);
  properties["first_seen"] = Rfc3339(feature.first_seen_ns);
  properties["last_seen"] = Rfc3339(feature.last_seen_ns);
  properties["updated"] = Rfc3339(feature.updated_ns);
  properties["position_sigma_m"] = PositionSigma(feature.covariance_m2);
  properties["sequence"] = feature.sequence;
  return json;
}

Json MapChangeEventJson(const zone::StoredMapChangeEvent& event) {
  Json json;
  json["sequence"] = event.sequence;
  json["from"] = event.from ? Json(zone::MapChangeStateName(*event.from)) : Json(nullptr);
  json["to"] = zone::MapChangeStateName(event.to);
  json["reason"] = event.reason;
  json["time"] = Rfc3339(event.at_ns);
  return json;
}

Json MapChangeMessage(zone::HazardAction action, const zone::MapChangeFeature& feature) {
  Json message;
  message["type"] = "change";
  message["action"] = ActionName(action);
  message["sequence"] = feature.sequence;
  message["feature"] = MapChangeGeoJson(feature);
  return message;
}

}  // namespace livemap::web
