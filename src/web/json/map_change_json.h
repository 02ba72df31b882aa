#pragma once

#include "web/json/json.h"
#include "zone/model/map_change.h"

namespace livemap::web {

/// What a client that knows nothing newer than the feature's predecessor should do with it.
zone::HazardAction ReplayAction(const zone::MapChangeFeature& feature);

/// The map change as a GeoJSON Feature (RFC 7946).
Json MapChangeGeoJson(const zone::MapChangeFeature& feature);

/// One line of its history: sequence, from, to, reason, time.
Json MapChangeEventJson(const zone::StoredMapChangeEvent& event);

/// The message of the live stream for one event.
Json MapChangeMessage(zone::HazardAction action, const zone::MapChangeFeature& feature);

}  // namespace livemap::web
