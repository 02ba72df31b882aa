#include "geo/spatial_grid.h"

#include <GeographicLib/Geocentric.hpp>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"

namespace livemap {
namespace {

/// Earth-centred position of a place on the ellipsoid, metres.
Eigen::Vector3d ToEarth(const GeoPoint& place) {
  Eigen::Vector3d earth_m;
  GeographicLib::Geocentric::WGS84().Forward(place.latitude_deg, place.longitude_deg, 0.0,
                                             earth_m.x(), earth_m.y(), earth_m.z());
  return earth_m;
}

}  // namespace

SpatialGrid SpatialGrid::ForRadius(double radius_m, std::uint64_t hash_seed) {
  constexpr double kCellInRadii = 6.0;
  return SpatialGrid(kCellInRadii * radius_m, hash_seed);
}

SpatialGrid::SpatialGrid(double cell_m, std::uint64_t hash_seed)
    : cell_m_(cell_m), hash_seed_(hash_seed), slots_(16) {
  if (!(cell_m >= 0.01 && cell_m <= 1e6)) {
    throw Error("the cell of a spatial grid is " + std::to_string(cell_m) +
                " m, accepted is 0.01 to 1000000 m");
  }
}

void SpatialGrid::Insert(const GeoPoint& place, std::uint64_t id) {
  if (!IsValid(place)) throw Error("a place of a spatial grid is no valid position");
  if (2 * (entries_.size() + 1) > slots_.size()) Grow();
  const Eigen::Vector3d earth_m = ToEarth(place);
  PutSlot({Hash(CellAt(earth_m)), static_cast<std::uint32_t>(entries_.size())});
  entries_.push_back({earth_m, place, id});
}

bool SpatialGrid::Erase(const GeoPoint& place, std::uint64_t id) {
  if (!IsValid(place)) return false;
  const std::uint32_t hash = Hash(CellAt(ToEarth(place)));
  for (std::size_t i = Home(hash); slots_[i].entry != kEmpty; i = Next(i)) {
    const std::uint32_t index = slots_[i].entry;
    if (slots_[i].hash != hash || entries_[index].id != id ||
        entries_[index].place.latitude_deg != place.latitude_deg ||
        entries_[index].place.longitude_deg != place.longitude_deg) {
      continue;
    }
    ClearSlot(i);
    // The last entry fills the hole, so that entries stay dense.
    const auto last = static_cast<std::uint32_t>(entries_.size() - 1);
    if (index != last) {
      slots_[FindSlot(Hash(CellAt(entries_[last].earth_m)), last)].entry = index;
      entries_[index] = entries_[last];
    }
    entries_.pop_back();
    return true;
  }
  return false;
}

std::optional<SpatialGrid::Neighbour> SpatialGrid::Nearest(const GeoPoint& centre,
                                                           double radius_m) const {
  if (!IsValid(centre) || !(radius_m >= 0)) return std::nullopt;
  Search search{centre, ToEarth(centre), radius_m, std::nullopt};
  const Cell low = CellAt(search.earth_m.array() - search.ChordM());
  const Cell high = CellAt(search.earth_m.array() + search.ChordM());
  // In a large table every cell is a cache miss: ask for several at once, then read them.
  std::array<std::uint32_t, 16> waiting;
  std::size_t count = 0;
  const auto read_waiting = [&] {
    for (std::size_t i = 0; i < count; ++i) ReadCell(waiting[i], search);
    count = 0;
  };
  Cell cell;
  for (cell[0] = low[0]; cell[0] <= high[0]; ++cell[0]) {
    for (cell[1] = low[1]; cell[1] <= high[1]; ++cell[1]) {
      for (cell[2] = low[2]; cell[2] <= high[2]; ++cell[2]) {
        waiting[count] = Hash(cell);
        __builtin_prefetch(&slots_[Home(waiting[count])]);
        if (++count == waiting.size()) read_waiting();
      }
    }
  }
  read_waiting();
  return search.nearest;
}

std::vector<SpatialGrid::Neighbour> SpatialGrid::Within(const GeoPoint& centre,
                                                        double radius_m) const {
  std::vector<Neighbour> found;
  if (!IsValid(centre) || !(radius_m >= 0)) return found;
  const Search search{centre, ToEarth(centre), radius_m, std::nullopt};
  const Cell low = CellAt(search.earth_m.array() - search.ChordM());
  const Cell high = CellAt(search.earth_m.array() + search.ChordM());
  std::vector<std::uint32_t> hashes;
  Cell cell;
  for (cell[0] = low[0]; cell[0] <= high[0]; ++cell[0]) {
    for (cell[1] = low[1]; cell[1] <= high[1]; ++cell[1]) {
      for (cell[2] = low[2]; cell[2] <= high[2]; ++cell[2]) hashes.push_back(Hash(cell));
    }
  }
  // Two cells may share a hash: what is found by it must not be found twice.
  std::sort(hashes.begin(), hashes.end());
  hashes.erase(std::unique(hashes.begin(), hashes.end()), hashes.end());
  for (const std::uint32_t hash : hashes) {
    for (std::size_t i = Home(hash); slots_[i].entry != kEmpty; i = Next(i)) {
      if (slots_[i].hash != hash) continue;
      const Entry& entry = entries_[slots_[i].entry];
      if ((entry.earth_m - search.earth_m).squaredNorm() > search.ChordM() * search.ChordM())
        continue;
      const double distance_m = GeodesicDistanceM(entry.place, centre);
      if (distance_m <= radius_m) found.push_back({entry.id, distance_m});
    }
  }
  return found;
}

void SpatialGrid::ReadCell(std::uint32_t hash, Search& search) const {
  for (std::size_t i = Home(hash); slots_[i].entry != kEmpty; i = Next(i)) {
    if (slots_[i].hash != hash) continue;
    const Entry& entry = entries_[slots_[i].entry];
    if ((entry.earth_m - search.earth_m).squaredNorm() > search.ChordM() * search.ChordM())
      continue;
    const double distance_m = GeodesicDistanceM(entry.place, search.centre);
    if (distance_m > search.radius_m) continue;
    const auto& nearest = search.nearest;
    if (!nearest || distance_m < nearest->distance_m ||
        (distance_m == nearest->distance_m && entry.id < nearest->id)) {
      search.nearest = {entry.id, distance_m};
    }
  }
}

SpatialGrid::Cell SpatialGrid::CellAt(const Eigen::Vector3d& earth_m) const {
  Cell cell;
  for (int axis = 0; axis < 3; ++axis) {
    cell[static_cast<std::size_t>(axis)] =
        static_cast<std::int32_t>(std::floor(earth_m[axis] / cell_m_));
  }
  return cell;
}

std::uint32_t SpatialGrid::Hash(const Cell& cell) const {
  // Multiply and fold per axis (the finaliser of splitmix64), so that neighbouring cells scatter.
  std::uint64_t hash = hash_seed_;
  for (const std::int32_t index : cell) {
    hash ^= static_cast<std::uint32_t>(index);
    hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9u;
    hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebu;
    hash ^= hash >> 31;
  }
  return static_cast<std::uint32_t>(hash);
}

std::size_t SpatialGrid::FindSlot(std::uint32_t hash, std::uint32_t entry) const {
  std::size_t i = Home(hash);
  while (slots_[i].entry != entry) i = Next(i);
  return i;
}

void SpatialGrid::PutSlot(Slot slot) {
  std::size_t i = Home(slot.hash);
  while (slots_[i].entry != kEmpty) i = Next(i);
  slots_[i] = slot;
}

void SpatialGrid::ClearSlot(std::size_t slot) {
  // Backward shift (Knuth, TAOCP 6.4 R): what follows in the run moves up unless it stands between
  // its home and the hole already; no tombstones, so searches stay short for ever.
  std::size_t hole = slot;
  for (std::size_t i = Next(slot); slots_[i].entry != kEmpty; i = Next(i)) {
    const std::size_t home = Home(slots_[i].hash);
    const bool stays = hole <= i ? (hole < home && home <= i) : (hole < home || home <= i);
    if (stays) continue;
    slots_[hole] = slots_[i];
    hole = i;
  }
  slots_[hole] = Slot{};
}

void SpatialGrid::Grow() {
  std::vector<Slot> old(2 * slots_.size());
  old.swap(slots_);
  for (const Slot& slot : old) {
    if (slot.entry != kEmpty) PutSlot(slot);
  }
}

}  // namespace livemap
