#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/huge_pages.h"
#include "geo/wgs84.h"

namespace livemap::geo {

/// Places on the earth, found by distance at a cost that does not grow with their number.
///
/// The grid has cubic cells in earth-centred axes, hashed into one flat table. So there is no
/// seam at the antimeridian, no pole, and no cell whose width depends on the latitude. Not
/// thread-safe.
class SpatialGrid {
 public:
  struct Neighbour {
    std::uint64_t id;
    double distance_m;  ///< Geodesic.
  };

  /// A grid for searches of about this radius, metres. Cells are six radii wide: a search reads
  /// (1 + 2/6)^3, about 2.4 of them, and even a street where a hazard lies at every radius puts
  /// only some dozens into one. `hash_seed` makes the table's order unpredictable to whoever
  /// chooses the places; results do not depend on it.
  static SpatialGrid ForRadius(double radius_m, std::uint64_t hash_seed = 0);

  /// `cell_m`: edge of a cell, 0.01 to 1e6 metres; Error otherwise.
  explicit SpatialGrid(double cell_m, std::uint64_t hash_seed = 0);

  /// Adds a place. Ids are the caller's; the same id may stand at several places.
  void Insert(const GeoPoint& place, std::uint64_t id);
  /// Removes what Insert added with exactly these values; false when there is none.
  bool Erase(const GeoPoint& place, std::uint64_t id);
  /// The same as Erase and Insert, and cheaper over a short way; false when nothing stands there.
  bool Move(const GeoPoint& from, const GeoPoint& to, std::uint64_t id);
  /// The nearest place within `radius_m` (inclusive) of `centre`, the lowest id among equals.
  std::optional<Neighbour> Nearest(const GeoPoint& centre, double radius_m) const;
  /// Every place within `radius_m` (inclusive) of `centre`, in no order; distances are right to
  /// 0.1 mm. Costs one cell of the table per cell that the radius touches: for radii of some cells.
  std::vector<Neighbour> Within(const GeoPoint& centre, double radius_m) const;

  std::size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    Eigen::Vector3d earth_m;
    GeoPoint place;
    std::uint64_t id;
  };
  // Where in its cell a place lies, in 65536ths of the cell's edge.
  using Offset = std::array<std::uint16_t, 3>;
  // One place of the hash table: the hash of the cell, where its entry stands, and roughly where
  // that lies, so that entries too far away need not be looked at.
  struct Slot {
    std::uint32_t hash = 0;
    std::uint32_t entry = kEmpty;
    Offset offset{};
  };
  struct Search {
    GeoPoint centre;
    Eigen::Vector3d earth_m;
    double radius_m;
    std::optional<Neighbour> nearest;

    // A chord is never longer than the geodesic, so no place within the radius is missed; the
    // micrometre absorbs rounding. The geodesic decides.
    double ChordM() const { return radius_m + 1e-6; }
  };
  using Cell = std::array<std::int32_t, 3>;
  static constexpr std::uint32_t kEmpty = 0xffffffff;

  void ReadCell(const Cell& cell, std::uint32_t hash, Search& search) const;
  Offset OffsetIn(const Cell& cell, const Eigen::Vector3d& earth_m) const;
  Slot SlotOf(const Eigen::Vector3d& earth_m, std::uint32_t entry) const;
  std::optional<std::size_t> FindPlace(const Slot& like, const GeoPoint& place,
                                       std::uint64_t id) const;
  Cell CellAt(const Eigen::Vector3d& earth_m) const;
  std::uint32_t Hash(const Cell& cell) const;
  std::size_t Next(std::size_t slot) const { return (slot + 1) & (slots_.size() - 1); }
  std::size_t Home(std::uint32_t hash) const { return hash & (slots_.size() - 1); }
  std::size_t FindSlot(std::uint32_t hash, std::uint32_t entry) const;
  void PutSlot(Slot slot);
  void ClearSlot(std::size_t slot);
  void Grow();

  double cell_m_;
  std::uint64_t hash_seed_;
  std::vector<Slot, HugePageAllocator<Slot>>
      slots_;  // Size a power of two, at most half full, linear probing.
  std::vector<Entry, HugePageAllocator<Entry>> entries_;
};

}  // namespace livemap::geo
