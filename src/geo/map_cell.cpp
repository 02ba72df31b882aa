#include "geo/map_cell.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace livemap::geo {
namespace {

constexpr std::uint32_t kCellsPerSide = 1U << MapCell::kZoom;
constexpr std::uint32_t kCells = 1U << (2 * MapCell::kZoom);
constexpr double kPi = 180.0 * kRadiansPerDegree;

/// Of a row's northern edge. The outermost edges are the poles.
double CellEdgeLatitudeDeg(std::uint32_t row) {
  if (row == 0) return 90;
  if (row >= kCellsPerSide) return -90;
  return std::atan(std::sinh(kPi * (1 - 2.0 * row / kCellsPerSide))) / kRadiansPerDegree;
}

double CellEdgeLongitudeDeg(std::uint32_t column) { return 360.0 * column / kCellsPerSide - 180; }

}  // namespace

MapCell::MapCell(std::uint32_t column, std::uint32_t row) : number_(0) {
  for (int bit = 0; bit < kZoom; ++bit) {
    number_ |= (column >> bit & 1U) << (2 * bit) | (row >> bit & 1U) << (2 * bit + 1);
  }
}

std::uint32_t MapCell::column() const {
  std::uint32_t column = 0;
  for (int bit = 0; bit < kZoom; ++bit) column |= (number_ >> (2 * bit) & 1U) << bit;
  return column;
}

std::uint32_t MapCell::row() const {
  std::uint32_t row = 0;
  for (int bit = 0; bit < kZoom; ++bit) row |= (number_ >> (2 * bit + 1) & 1U) << bit;
  return row;
}

MapCell MapCell::At(const GeoPoint& point) {
  const double east = (point.longitude_deg + 180) / 360 * kCellsPerSide;
  // Of 180 degrees it is one more than there are: the first one.
  const auto column = static_cast<std::uint32_t>(std::max(east, 0.0)) % kCellsPerSide;
  // At a pole infinite.
  const double mercator = std::asinh(std::tan(point.latitude_deg * kRadiansPerDegree));
  const double south = (1 - mercator / kPi) / 2 * kCellsPerSide;
  const auto row =
      static_cast<std::uint32_t>(std::clamp(south, 0.0, static_cast<double>(kCellsPerSide - 1)));
  return {column, row};
}

std::optional<MapCell> MapCell::FromNumber(std::uint32_t number) {
  if (number >= kCells) return std::nullopt;
  return MapCell(number);
}

std::optional<MapCell> MapCell::FromQuadkey(std::string_view quadkey) {
  if (quadkey.size() != kZoom) return std::nullopt;
  std::uint32_t number = 0;
  for (const char digit : quadkey) {
    if (digit < '0' || digit > '3') return std::nullopt;
    number = number << 2U | static_cast<std::uint32_t>(digit - '0');
  }
  return MapCell(number);
}

std::string MapCell::Quadkey() const {
  std::string quadkey;
  for (int place = kZoom - 1; place >= 0; --place) {
    quadkey += static_cast<char>('0' + (number_ >> (2 * place) & 3U));
  }
  return quadkey;
}

double MapCell::SouthDeg() const { return CellEdgeLatitudeDeg(row() + 1); }

double MapCell::NorthDeg() const { return CellEdgeLatitudeDeg(row()); }

GeoPoint MapCell::Middle() const {
  return {(SouthDeg() + NorthDeg()) / 2,
          (CellEdgeLongitudeDeg(column()) + CellEdgeLongitudeDeg(column() + 1)) / 2};
}

double MapCell::DistanceM(const GeoPoint& point) const {
  GeoPoint nearest;
  nearest.latitude_deg = std::clamp(point.latitude_deg, SouthDeg(), NorthDeg());
  const double west_deg = CellEdgeLongitudeDeg(column());
  const double east_deg = CellEdgeLongitudeDeg(column() + 1);
  // The short way round.
  const double from_middle_deg =
      std::remainder(point.longitude_deg - (west_deg + east_deg) / 2, 360.0);
  const double half_deg = (east_deg - west_deg) / 2;
  nearest.longitude_deg =
      (west_deg + east_deg) / 2 + std::clamp(from_middle_deg, -half_deg, half_deg);
  if (std::abs(from_middle_deg) <= half_deg && nearest.latitude_deg == point.latitude_deg) return 0;
  return GeodesicDistanceM(point, nearest);
}

std::vector<MapCell> MapCellsWithin(const GeoPoint& centre, double radius_m, std::size_t limit) {
  const MapCell own = MapCell::At(centre);
  std::vector<std::pair<double, MapCell>> found;
  // Whether a cell of the row is within the radius. Outward from the centre's column they only get
  // further away. Near a pole there are many: more than `limit` of one row are never wanted.
  const auto add_row = [&](std::uint32_t row) {
    const std::size_t before = found.size();
    const auto add = [&](std::uint32_t column) {
      const MapCell cell(column % kCellsPerSide, row);
      const double distance_m = cell.DistanceM(centre);
      if (distance_m <= radius_m) found.emplace_back(distance_m, cell);
      return distance_m <= radius_m;
    };
    if (!add(own.column())) return false;
    bool is_east = true;
    bool is_west = true;
    for (std::uint32_t away = 1; away <= kCellsPerSide / 2 && (is_east || is_west); ++away) {
      is_east = is_east && add(own.column() + away);
      is_west = is_west && away < kCellsPerSide / 2 && add(own.column() + kCellsPerSide - away);
      if (found.size() - before > 2 * limit) break;
    }
    return true;
  };
  add_row(own.row());
  for (std::uint32_t row = own.row() + 1; row < kCellsPerSide && add_row(row); ++row) {
  }
  for (std::uint32_t row = own.row(); row > 0 && add_row(row - 1); --row) {
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  if (found.size() > limit)
    found.erase(found.begin() + static_cast<std::ptrdiff_t>(limit), found.end());
  std::vector<MapCell> cells;
  cells.reserve(found.size());
  for (const auto& [distance_m, cell] : found) cells.push_back(cell);
  return cells;
}

}  // namespace livemap::geo
