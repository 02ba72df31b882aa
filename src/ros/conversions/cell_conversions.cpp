#include "ros/conversions/cell_conversions.h"

#include <cstddef>
#include <cstdint>
#include <utility>

#include "common/error.h"
#include "ros/conversions/hazard_conversions.h"
#include "ros/conversions/message_fields.h"
#include "ros/conversions/trail_conversions.h"

namespace livemap::ros_io {
namespace {

/// As many elements as a bridge takes.
constexpr std::size_t kMaxTrailsOfMessage = 1024;

geo::MapCell ToMapCell(std::uint32_t number, const char* message_name) {
  const auto cell = geo::MapCell::FromNumber(number);
  if (!cell) {
    throw Error(std::string(message_name) + " names cell " + std::to_string(number) +
                ", accepted is 0 to 1073741823");
  }
  return *cell;
}

void CheckCellCount(std::size_t count, const char* message_name) {
  if (count <= protocol::kMaxRequestedCells) return;
  throw Error(std::string(message_name) + " names " + std::to_string(count) +
              " cells, accepted are at most " + std::to_string(protocol::kMaxRequestedCells));
}

CellHazard ToCellMessage(const protocol::CellNews::Hazard& hazard) {
  CellHazard message;
  message.hazard_uuid = ToBytes(hazard.hazard_uuid);
  message.sequence = hazard.sequence;
  message.removed = static_cast<std::uint8_t>(hazard.removed);
  message.class_name = hazard.class_name;
  message.confidence = hazard.confidence;
  message.latitude = hazard.position.latitude_deg;
  message.longitude = hazard.position.longitude_deg;
  message.stamp = ToRosTime(hazard.stamp_ns);
  return message;
}

protocol::CellNews::Hazard FromCellMessage(const CellHazard& message) {
  protocol::CellNews::Hazard hazard;
  hazard.hazard_uuid = ToUuid(message.hazard_uuid);
  hazard.sequence = message.sequence;
  hazard.removed = message.removed != 0;
  hazard.class_name = message.class_name;
  hazard.confidence = message.confidence;
  hazard.position = {message.latitude, message.longitude};
  hazard.stamp_ns = FromRosTime(message.stamp);
  return hazard;
}

}  // namespace

CellRequest ToMessage(const protocol::CellRequest& request) {
  CellRequest message;
  message.schema_version = CellRequest::SCHEMA_VERSION;
  message.vehicle_id = request.vehicle_id;
  for (const protocol::CellRequest::Cell& cell : request.cells) {
    message.cells.push_back(cell.cell.number());
    message.sequences.push_back(cell.sequence);
  }
  message.zone = request.zone;
  return message;
}

protocol::CellRequest FromMessage(const CellRequest& message) {
  constexpr char kName[] = "cell request";
  CheckVersion(message, kName);
  CheckCellCount(message.cells.size(), kName);
  if (message.sequences.size() != message.cells.size()) {
    throw Error("cell request names " + std::to_string(message.cells.size()) + " cells and " +
                std::to_string(message.sequences.size()) +
                " sequences, accepted is one sequence for each cell");
  }
  protocol::CellRequest request;
  request.vehicle_id = message.vehicle_id;
  for (std::size_t i = 0; i < message.cells.size(); ++i) {
    request.cells.push_back({ToMapCell(message.cells[i], kName), message.sequences[i]});
  }
  request.zone = message.zone;
  return request;
}

/// Those of each hazard of the message.
std::vector<std::vector<protocol::Trail>> TrailsOf(const CellHazards& message) {
  std::vector<std::vector<protocol::Trail>> trails(message.hazards.size());
  for (const HazardTrail& trail : message.trails) {
    if (trail.hazard >= message.hazards.size()) {
      throw Error("message of cells has a trail of hazard " + std::to_string(trail.hazard) +
                  ", accepted is less than " + std::to_string(message.hazards.size()));
    }
    const CellHazard& hazard = message.hazards[trail.hazard];
    TakeTrail(trail, {hazard.latitude, hazard.longitude}, "message of cells", trails[trail.hazard]);
  }
  return trails;
}

CellHazards ToMessage(const protocol::CellNews& news) {
  CellHazards message;
  message.schema_version = CellHazards::SCHEMA_VERSION;
  message.vehicle_id = news.vehicle_id;
  for (const protocol::CellNews::Cell& cell : news.cells) {
    CellState state;
    state.cell = cell.cell.number();
    state.since = cell.since;
    state.sequence = cell.sequence;
    state.hazards = static_cast<std::uint32_t>(cell.hazards.size());
    message.cells.push_back(state);
    for (const protocol::CellNews::Hazard& hazard : cell.hazards) {
      message.hazards.push_back(ToCellMessage(hazard));
      if (message.trails.size() + protocol::kMaxTrails <= kMaxTrailsOfMessage) {
        AppendTrails(hazard.trails, hazard.position,
                     static_cast<std::uint16_t>(message.courses.size()), message.trails);
      }
      message.courses.push_back(static_cast<float>(hazard.course_rad));
    }
  }
  message.zone = news.zone;
  return message;
}

protocol::CellNews FromMessage(const CellHazards& message) {
  constexpr char kName[] = "message of cells";
  constexpr std::uint16_t kWithoutCourses = 1;
  CheckVersion(message, kName, kWithoutCourses);
  CheckCellCount(message.cells.size(), kName);
  protocol::CellNews news;
  news.vehicle_id = message.vehicle_id;
  const std::size_t courses = message.courses.size();
  if (courses != 0 && courses != message.hazards.size()) {
    throw Error("message of cells has " + std::to_string(message.hazards.size()) + " hazards and " +
                std::to_string(courses) +
                " courses, accepted is one course for each hazard, or none at all");
  }
  const std::vector<std::vector<protocol::Trail>> trails = TrailsOf(message);
  auto next = message.hazards.begin();
  for (const CellState& state : message.cells) {
    const auto left = static_cast<std::size_t>(message.hazards.end() - next);
    if (state.hazards > left) {
      throw Error("message of cells says that " + std::to_string(state.hazards) +
                  " hazards belong to a cell, accepted are the " + std::to_string(left) +
                  " that are left");
    }
    protocol::CellNews::Cell cell{ToMapCell(state.cell, kName), state.since, state.sequence, {}};
    cell.hazards.reserve(state.hazards);
    for (std::uint32_t i = 0; i < state.hazards; ++i) {
      cell.hazards.push_back(FromCellMessage(*next));
      const auto number = static_cast<std::size_t>(next - message.hazards.begin());
      if (courses != 0) {
        cell.hazards.back().course_rad = static_cast<double>(message.courses[number]);
      }
      cell.hazards.back().trails = trails[number];
      ++next;
    }
    news.cells.push_back(std::move(cell));
  }
  if (next != message.hazards.end()) {
    throw Error("message of cells has " + std::to_string(message.hazards.end() - next) +
                " hazards of no cell, accepted is none");
  }
  news.zone = message.zone;
  return news;
}

VehicleCells ToMessage(const std::vector<geo::MapCell>& cells, const std::string& zone) {
  VehicleCells message;
  for (const geo::MapCell& cell : cells) message.cells.push_back(cell.number());
  message.zone = zone;
  return message;
}

std::vector<geo::MapCell> FromMessage(const VehicleCells& message) {
  constexpr char kName[] = "list of cells";
  CheckCellCount(message.cells.size(), kName);
  std::vector<geo::MapCell> cells;
  for (const std::uint32_t number : message.cells) cells.push_back(ToMapCell(number, kName));
  return cells;
}

}  // namespace livemap::ros_io
