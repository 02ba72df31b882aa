#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "common/uuid.h"
#include "geo/map_cell.h"
#include "geo/wgs84.h"
#include "protocol/trail.h"

namespace livemap::protocol {

/// Cells that one request may name; a zone refuses more.
constexpr std::size_t kMaxRequestedCells = 64;
/// Hazards of one cell that a zone tells at most, the newest ones.
constexpr std::size_t kMaxHazardsOfCell = 1000;

/// A vehicle asks the zone what it lacks of cells of the map (CellRequest.msg without ROS).
struct CellRequest {
  struct Cell {
    geo::MapCell cell;
    std::uint64_t sequence = 0;  ///< Up to which announcement all of it is known; 0: nothing is.
  };

  std::string vehicle_id;
  std::vector<Cell> cells;
  std::string zone;  ///< Id of the zone that is asked; empty at the zone.
};

/// The zone tells one vehicle what it lacks of cells of the map (CellHazards.msg without ROS).
/// Without cells: the vehicle is to ask again, because the zone knows nothing of it.
struct CellNews {
  struct Hazard {
    Uuid hazard_uuid;
    std::uint64_t sequence = 0;  ///< Of its last announcement.
    bool removed = false;        ///< Drivers know it no longer in this cell; the rest is empty.
    std::string class_name;
    float confidence = 0;  ///< 0..1.
    geo::GeoPoint position;
    std::int64_t stamp_ns = 0;  ///< Of its last event, zone clock (UTC).
    /// As Notice::course_rad.
    double course_rad = std::numeric_limits<double>::quiet_NaN();
    std::vector<Trail> trails{};  ///< As Notice::trails.
  };
  struct Cell {
    geo::MapCell cell;
    std::uint64_t since = 0;     ///< What the vehicle knew; 0: all that is there is told.
    std::uint64_t sequence = 0;  ///< Up to which announcement it knows all of the cell with this.
    std::vector<Hazard> hazards;

    /// What is not told is gone: the vehicle knew nothing, or its zone began anew since.
    bool is_whole() const { return since == 0 || since > sequence; }
  };

  std::string vehicle_id;
  std::vector<Cell> cells;
  std::string zone;  ///< Id of the zone that says so; empty at the zone.
};

}  // namespace livemap::protocol
