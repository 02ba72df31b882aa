#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "geo/wgs84.h"

namespace livemap {

/// Positions of the active hazards of one class, found by place: a hash grid over 1e-7 degree
/// integers, whose cells are two radii high and at least two radii wide at every latitude.
///
/// A query reads at most nine cells away from the poles, whatever the number of entries, and
/// allocates nothing. Nothing within the radius is missed: cells and candidates are chosen by lower
/// bounds of the ellipsoid's distance, at the antimeridian and the poles too.
class HazardGrid {
 public:
  using Slot = std::uint32_t;
  struct Neighbour {
    Slot slot = 0;
    double distance_m = 0;
  };

  /// `radius_m` > 0 is the greatest distance that Nearest will find. `hash_seed` makes the table's
  /// order unpredictable to whoever chooses the positions; results do not depend on it.
  HazardGrid(double radius_m, std::uint64_t hash_seed);

  void Insert(const GeoPoint& position, Slot slot);
  /// `position` must be the one that `slot` was inserted with.
  void Erase(const GeoPoint& position, Slot slot);
  std::size_t size() const { return size_; }

  /// The nearest entry within the radius, the lowest slot among equals. `distance_m(slot)` gives
  /// the exact distance; it is asked only about entries that may be within the radius.
  template <typename DistanceOf>
  std::optional<Neighbour> Nearest(const GeoPoint& position, const DistanceOf& distance_m) const;

 private:
  struct Entry {
    std::uint64_t cell = kFree;
    GeoPointE7 position;
    Slot slot = 0;
  };
  /// Longitudes in steps of 1e-7 degree east of the antimeridian: 0 up to kTurn - 1.
  static constexpr std::int64_t kTurn = 3'600'000'000;
  static constexpr std::int64_t kHalfTurn = kTurn / 2;
  static constexpr std::uint64_t kFree = ~std::uint64_t{0};

  /// Around one query: which cells may hold neighbours, and how far a candidate is at least.
  struct Search {
    std::int64_t latitude_e7 = 0;
    std::int64_t longitude_e7 = 0;  ///< East of the antimeridian.
    std::int64_t first_band = 0;
    std::int64_t last_band = 0;
    std::int64_t half_width_e7 = 0;      ///< Greatest difference in longitude.
    double metres_per_longitude_e7 = 0;  ///< At the poleward edge of the search; 0 at a pole.
  };

  Search SearchAround(const GeoPointE7& position) const;
  double LeastDistanceM(const Search& search, const GeoPointE7& position) const;
  std::int64_t Band(std::int64_t latitude_e7) const;
  std::int64_t Columns(std::int64_t band) const;
  std::uint64_t Cell(const GeoPointE7& position) const;
  std::size_t Home(std::uint64_t cell) const;
  void Place(const Entry& entry);
  void Grow();

  /// Calls `visit(cell)` for every cell that the search must read.
  template <typename Visit>
  void ForEachCell(const Search& search, const Visit& visit) const;

  double radius_m_;
  std::uint64_t hash_seed_;
  std::int64_t band_height_e7_;
  std::size_t size_ = 0;
  std::vector<Entry>
      table_;  ///< Open addressing, linear probing, a power of two, half full at most.
};

template <typename Visit>
void HazardGrid::ForEachCell(const Search& search, const Visit& visit) const {
  for (std::int64_t band = search.first_band; band <= search.last_band; ++band) {
    const std::int64_t columns = Columns(band);
    // Offset by one turn so that the divisions round down also west of the antimeridian.
    const std::int64_t west = search.longitude_e7 - search.half_width_e7 + kTurn;
    const std::int64_t east = search.longitude_e7 + search.half_width_e7 + kTurn;
    const auto column_of = [columns](std::int64_t longitude_e7) {
      return longitude_e7 / kTurn * columns + longitude_e7 % kTurn * columns / kTurn;
    };
    const std::int64_t first = column_of(west);
    const std::int64_t count = column_of(east) - first + 1;
    for (std::int64_t i = 0; i < (count < columns ? count : columns); ++i) {
      visit(static_cast<std::uint64_t>(band) << 32 |
            static_cast<std::uint64_t>((first + i) % columns));
    }
  }
}

template <typename DistanceOf>
std::optional<HazardGrid::Neighbour> HazardGrid::Nearest(const GeoPoint& position,
                                                         const DistanceOf& distance_m) const {
  // E7 rounding moves each of the two positions by less than 8 mm.
  constexpr double kRoundingM = 0.02;
  const Search search = SearchAround(ToE7(position));
  std::optional<Neighbour> nearest;
  const auto read_cell = [&](std::uint64_t cell) {
    const std::size_t mask = table_.size() - 1;
    for (std::size_t i = Home(cell); table_[i].cell != kFree; i = (i + 1) & mask) {
      const Entry& entry = table_[i];
      if (entry.cell != cell) continue;
      if (LeastDistanceM(search, entry.position) > radius_m_ + kRoundingM) continue;
      const double distance = distance_m(entry.slot);
      if (distance > radius_m_) continue;
      if (!nearest || distance < nearest->distance_m ||
          (distance == nearest->distance_m && entry.slot < nearest->slot)) {
        nearest = Neighbour{entry.slot, distance};
      }
    }
  };
  // Ask for the memory of several cells at once, then read: in a large table every cell is a cache
  // miss, and they should overlap.
  std::array<std::uint64_t, 16> waiting;
  std::size_t count = 0;
  const auto read_waiting = [&] {
    for (std::size_t i = 0; i < count; ++i) read_cell(waiting[i]);
    count = 0;
  };
  ForEachCell(search, [&](std::uint64_t cell) {
    __builtin_prefetch(&table_[Home(cell)]);
    waiting[count++] = cell;
    if (count == waiting.size()) read_waiting();
  });
  read_waiting();
  return nearest;
}

}  // namespace livemap
