#pragma once

#include <livemap/CellHazards.h>
#include <livemap/CellRequest.h>
#include <livemap/VehicleCells.h>

#include <string>
#include <vector>

#include "geo/map_cell.h"
#include "protocol/cell_news.h"

namespace livemap::ros_io {

// What crosses between the core and the messages of cells, in both directions. FromMessage throws
// Error, with one sentence that says why, for what the message's definition does not allow.

CellRequest ToMessage(const protocol::CellRequest& request);
protocol::CellRequest FromMessage(const CellRequest& message);

CellHazards ToMessage(const protocol::CellNews& news);
/// Places, names and confidences are the receiver's business.
protocol::CellNews FromMessage(const CellHazards& message);

VehicleCells ToMessage(const std::vector<geo::MapCell>& cells, const std::string& zone = "");
/// At most protocol::kMaxRequestedCells.
std::vector<geo::MapCell> FromMessage(const VehicleCells& message);

}  // namespace livemap::ros_io
