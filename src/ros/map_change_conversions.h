#pragma once

#include <livemap/MapChange.h>

#include "hazard/map_change_report.h"

namespace livemap {

MapChange ToMessage(const MapChangeReport& report);
/// Throws Error for a schema version or a direction that is not known. What its numbers say is for
/// the zone to check.
MapChangeReport FromMessage(const MapChange& message);

}  // namespace livemap
