#pragma once

#include <livemap/HazardTrail.h>

#include <cstdint>
#include <vector>

#include "geo/wgs84.h"
#include "protocol/trail.h"

namespace livemap::ros_io {

/// Adds the trails of the hazard that has this number in the message, but for those that
/// protocol::ValidTrails leaves out.
void AppendTrails(const std::vector<protocol::Trail>& trails, const geo::GeoPoint& position,
                  std::uint16_t hazard, std::vector<HazardTrail>& messages);

/// Adds the trail of a hazard with this position to its trails. One of a hazard whose position is
/// not valid is left out: the hazard is the receiver's business. Throws Error, with one sentence
/// that names the message, for what HazardTrail.msg does not allow.
void TakeTrail(const HazardTrail& message, const geo::GeoPoint& position, const char* message_name,
               std::vector<protocol::Trail>& trails);

}  // namespace livemap::ros_io
