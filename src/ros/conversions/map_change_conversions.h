#pragma once

#include <livemap/MapChange.h>

#include <optional>
#include <string>

#include "change/objects/change_detector.h"
#include "protocol/map_change_report.h"

namespace livemap::ros_io {

MapChange ToMessage(const protocol::MapChangeReport& report);
/// Throws Error for a schema version or a direction that is not known. What its numbers say is for
/// the zone to check.
protocol::MapChangeReport FromMessage(const MapChange& message);

/// What the zone is told of an object that the vehicle has passed; nothing when nobody knows
/// whether it came or went.
std::optional<protocol::MapChangeReport> ToMapChangeReport(const change::PlacedChange& change,
                                                           const std::string& drive_id,
                                                           const Uuid& uuid);

}  // namespace livemap::ros_io
