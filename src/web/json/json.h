#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "protocol/hazard_catalogue.h"
#include "streets/street_place.h"
#include "zone/model/hazard.h"
#include "zone/service/zone_service.h"

namespace livemap::web {

/// Keys stay in the order in which a person reads them.
using Json = nlohmann::ordered_json;

/// JSON text in UTF-8; bytes that are no UTF-8 become U+FFFD, so that text that a vehicle sent
/// never breaks an answer.
std::string ToText(const Json& json);

/// Rounds to `digits` after the point: 1e-7 degree is a centimetre, and float32 noise such as
/// 0.8700000047683716 helps nobody.
double Rounded(double value, int digits);

/// A GeoJSON Feature without properties (RFC 7946, position as [longitude, latitude]).
Json PointFeature(const std::string& id, const geo::GeoPoint& position);

/// Standard deviation along the worst direction, metres; null when the covariance says nothing.
Json PositionSigma(const Eigen::Matrix2d& covariance_m2);

/// "added", "updated" or "removed".
const char* ActionName(zone::HazardAction action);

/// What a client that knows nothing newer than the hazard's predecessor should do with it.
zone::HazardAction ReplayAction(const zone::Hazard& hazard);

/// The hazard as a GeoJSON Feature (RFC 7946, position as [longitude, latitude]). `words` say where
/// it lies on the streets (ZoneService::WordsOf).
Json HazardFeature(const zone::Hazard& hazard, const protocol::HazardCatalogue& catalogue,
                   const streets::StreetWords& words);

/// One line of a hazard's history: sequence, action, from, to, reason, time.
Json EventJson(const zone::StoredEvent& event);

/// The message of the live stream for one hazard event.
Json HazardMessage(zone::HazardAction action, const zone::Hazard& hazard,
                   const protocol::HazardCatalogue& catalogue, const streets::StreetWords& words);

/// Positions as (longitude, latitude) degrees, oldest first.
using TrailPositions = std::vector<std::pair<double, double>>;

/// The vehicle as a GeoJSON Feature; `trail` is where it lately drove.
Json VehicleFeature(const zone::VehicleState& vehicle, const TrailPositions& trail);

/// The message of the live stream for one vehicle position (its feature has no trail).
Json VehicleMessage(const zone::VehicleState& vehicle);

/// The catalogue's classes for the map's filter: name, label, icon, colour.
Json ClassesJson(const protocol::HazardCatalogue& catalogue);

}  // namespace livemap::web
