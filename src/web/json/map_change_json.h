#pragma once

#include "web/json/json.h"
#include "zone/model/map_change.h"

namespace livemap {

/// What a client that knows nothing newer than the feature's predecessor should do with it.
HazardAction ReplayAction(const MapChangeFeature& feature);

/// The map change as a GeoJSON Feature (RFC 7946).
Json MapChangeGeoJson(const MapChangeFeature& feature);

/// One line of its history: sequence, from, to, reason, time.
Json MapChangeEventJson(const StoredMapChangeEvent& event);

/// The message of the live stream for one event.
Json MapChangeMessage(HazardAction action, const MapChangeFeature& feature);

}  // namespace livemap
