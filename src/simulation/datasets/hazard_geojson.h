#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "geo/wgs84.h"
#include "simulation/world/street.h"

namespace livemap::simulation {

/// The true hazards that at least one frame shows, as GeoJSON points (RFC 7946). `frames_seen`
/// counts by instance; `datum` is the world's origin; a hazard before `end_along_m`, where the
/// drive ends, is marked as passed.
std::string HazardsAsGeoJson(const Street& street, const geo::GeoPoint& datum,
                             const std::map<std::uint32_t, int>& frames_seen, double end_along_m);

}  // namespace livemap::simulation
