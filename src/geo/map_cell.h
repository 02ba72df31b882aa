#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geo/wgs84.h"

namespace livemap::geo {

/// A cell of the map, by which a zone tells vehicles what lies where: a tile of the Web Mercator
/// grid at zoom 15, about 1.2 km wide at the equator and 0.6 km at 60 degrees. Every valid point
/// lies in exactly one: the outermost rows reach from 85.05 degrees to the poles, and what lies on
/// the antimeridian belongs to its east. A point on an edge belongs to the cell in the east or
/// south of it.
class MapCell {
 public:
  static constexpr int kZoom = 15;

  /// The cell of a valid point.
  static MapCell At(const GeoPoint& point);
  /// The cell whose number() this is; none where there is no such cell.
  static std::optional<MapCell> FromNumber(std::uint32_t number);
  /// The cell whose Quadkey() this is; none where there is no such cell.
  static std::optional<MapCell> FromQuadkey(std::string_view quadkey);

  /// The quadkey, read as a number to the base 4; below 4^15.
  std::uint32_t number() const { return number_; }
  /// The tile's usual name: 15 digits of 0 to 3, the largest square first.
  std::string Quadkey() const;
  /// Latitudes of its edges, degrees; those of the outermost rows are the poles'.
  double SouthDeg() const;
  double NorthDeg() const;
  /// A point that lies in this cell.
  GeoPoint Middle() const;
  /// How far a valid point lies from the nearest point of this cell, metres, to a thousandth for
  /// distances of some kilometres; 0 inside.
  double DistanceM(const GeoPoint& point) const;

  bool operator==(const MapCell& other) const { return number_ == other.number_; }
  bool operator!=(const MapCell& other) const { return number_ != other.number_; }
  bool operator<(const MapCell& other) const { return number_ < other.number_; }

 private:
  MapCell(std::uint32_t column, std::uint32_t row);
  explicit MapCell(std::uint32_t number) : number_(number) {}
  friend std::vector<MapCell> MapCellsWithin(const GeoPoint& centre, double radius_m,
                                             std::size_t limit);

  std::uint32_t column() const;
  std::uint32_t row() const;

  std::uint32_t number_;
};

/// The cells that come as near to a valid point as `radius_m`, the nearest first, at most `limit`.
/// The point's own cell is the first one.
std::vector<MapCell> MapCellsWithin(const GeoPoint& centre, double radius_m, std::size_t limit);

}  // namespace livemap::geo
