#include "fleet_load/city_hazards.h"

#include <cmath>

namespace livemap::bench {
namespace {

std::int64_t CellIndex(double metres) {
  return static_cast<std::int64_t>(std::floor(metres / CityHazards::kCellM));
}

}  // namespace

std::optional<std::uint32_t> CityHazards::Add(const Eigen::Vector2d& place_m) {
  bool is_free = true;
  Visit(place_m, kApartM, [&is_free](std::uint32_t) { is_free = false; });
  if (!is_free) return std::nullopt;
  const auto hazard = static_cast<std::uint32_t>(places_.size());
  places_.push_back(place_m);
  is_there_.push_back(true);
  cells_[Cell(CellIndex(place_m.x()), CellIndex(place_m.y()))].push_back(hazard);
  return hazard;
}

std::optional<std::uint32_t> CityHazards::FindAt(const Eigen::Vector2d& place_m) const {
  std::optional<std::uint32_t> found;
  Visit(place_m, kApartM / 2, [&found](std::uint32_t hazard) { found = hazard; });
  return found;
}

void CityHazards::Visit(const Eigen::Vector2d& place_m, double radius_m,
                        const std::function<void(std::uint32_t)>& visit) const {
  for (std::int64_t east = CellIndex(place_m.x() - radius_m);
       east <= CellIndex(place_m.x() + radius_m); ++east) {
    for (std::int64_t north = CellIndex(place_m.y() - radius_m);
         north <= CellIndex(place_m.y() + radius_m); ++north) {
      const auto cell = cells_.find(Cell(east, north));
      if (cell == cells_.end()) continue;
      for (const std::uint32_t hazard : cell->second) {
        if ((places_[hazard] - place_m).norm() <= radius_m) visit(hazard);
      }
    }
  }
}

}  // namespace livemap::bench
