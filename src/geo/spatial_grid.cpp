#include "geo/spatial_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/error.h"

namespace livemap::geo {
namespace {

/// Geodesic distance of two places that are a chord apart. Solving the geodesic costs a
/// microsecond; over some kilometres the ellipsoid is a sphere, and an arc is longer than its chord
/// c by c^3 / (24 r^2): with the mean radius 0.02 mm off at 10 km.
double GridDistanceM(double chord_m, const GeoPoint& a, const GeoPoint& b) {
  constexpr double kFarM = 10e3;
  constexpr double kEarthRadiusM = 6371e3;
  if (chord_m > kFarM) return GeodesicDistanceM(a, b);
  const double ratio = chord_m / kEarthRadiusM;
  return chord_m * (1 + ratio * ratio / 24);
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

SpatialGrid::Slot SpatialGrid::SlotOf(const Eigen::Vector3d& earth_m, std::uint32_t entry) const {
  const Cell cell = CellAt(earth_m);
  return {Hash(cell), entry, OffsetIn(cell, earth_m)};
}

void SpatialGrid::Insert(const GeoPoint& place, std::uint64_t id) {
  if (!IsValid(place)) throw Error("a place of a spatial grid is no valid position");
  if (2 * (entries_.size() + 1) > slots_.size()) Grow();
  const Eigen::Vector3d earth_m = EarthCentred(place);
  PutSlot(SlotOf(earth_m, static_cast<std::uint32_t>(entries_.size())));
  entries_.push_back({earth_m, place, id});
}

/// The slot of what Insert added with exactly these values.
std::optional<std::size_t> SpatialGrid::FindPlace(const Slot& like, const GeoPoint& place,
                                                  std::uint64_t id) const {
  for (std::size_t i = Home(like.hash); slots_[i].entry != kEmpty; i = Next(i)) {
    if (slots_[i].hash != like.hash || slots_[i].offset != like.offset) continue;
    const Entry& entry = entries_[slots_[i].entry];
    if (entry.id == id && entry.place.latitude_deg == place.latitude_deg &&
        entry.place.longitude_deg == place.longitude_deg) {
      return i;
    }
  }
  return std::nullopt;
}

bool SpatialGrid::Erase(const GeoPoint& place, std::uint64_t id) {
  if (!IsValid(place)) return false;
  const auto found = FindPlace(SlotOf(EarthCentred(place), kEmpty), place, id);
  if (!found) return false;
  const std::uint32_t index = slots_[*found].entry;
  ClearSlot(*found);
  // The last entry fills the hole, so that entries stay dense.
  const auto last = static_cast<std::uint32_t>(entries_.size() - 1);
  if (index != last) {
    slots_[FindSlot(Hash(CellAt(entries_[last].earth_m)), last)].entry = index;
    entries_[index] = entries_[last];
  }
  entries_.pop_back();
  return true;
}

bool SpatialGrid::Move(const GeoPoint& from, const GeoPoint& to, std::uint64_t id) {
  if (!IsValid(from)) return false;
  if (!IsValid(to)) throw Error("a place of a spatial grid is no valid position");
  const auto found = FindPlace(SlotOf(EarthCentred(from), kEmpty), from, id);
  if (!found) return false;
  const std::uint32_t index = slots_[*found].entry;
  const Eigen::Vector3d earth_m = EarthCentred(to);
  const Slot slot = SlotOf(earth_m, index);
  if (slot.hash == slots_[*found].hash) {
    slots_[*found] = slot;
  } else {
    ClearSlot(*found);
    PutSlot(slot);
  }
  entries_[index] = {earth_m, to, id};
  return true;
}

std::optional<SpatialGrid::Neighbour> SpatialGrid::Nearest(const GeoPoint& centre,
                                                           double radius_m) const {
  if (!IsValid(centre) || !(radius_m >= 0)) return std::nullopt;
  Search search{centre, EarthCentred(centre), radius_m, std::nullopt};
  const Cell low = CellAt(search.earth_m.array() - search.ChordM());
  const Cell high = CellAt(search.earth_m.array() + search.ChordM());
  // In a large table every cell is a cache miss: ask for several at once, then read them.
  std::array<std::pair<Cell, std::uint32_t>, 16> waiting;
  std::size_t count = 0;
  const auto read_waiting = [&] {
    for (std::size_t i = 0; i < count; ++i) ReadCell(waiting[i].first, waiting[i].second, search);
    count = 0;
  };
  Cell cell;
  for (cell[0] = low[0]; cell[0] <= high[0]; ++cell[0]) {
    for (cell[1] = low[1]; cell[1] <= high[1]; ++cell[1]) {
      for (cell[2] = low[2]; cell[2] <= high[2]; ++cell[2]) {
        waiting[count] = {cell, Hash(cell)};
        __builtin_prefetch(&slots_[Home(waiting[count].second)]);
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
  const Search search{centre, EarthCentred(centre), radius_m, std::nullopt};
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
      const double squared_m2 = (entry.earth_m - search.earth_m).squaredNorm();
      if (squared_m2 > search.ChordM() * search.ChordM()) continue;
      const double distance_m = GridDistanceM(std::sqrt(squared_m2), entry.place, centre);
      if (distance_m <= radius_m) found.push_back({entry.id, distance_m});
    }
  }
  return found;
}

void SpatialGrid::ReadCell(const Cell& cell, std::uint32_t hash, Search& search) const {
  // In units of an offset, from the corner of the cell. An offset is rounded down by less than one
  // unit per axis: what lies further than two units beyond the chord cannot be within it.
  const double unit_m = cell_m_ / 65536.0;
  const Eigen::Vector3d corner = Eigen::Array3d(cell[0], cell[1], cell[2]) * cell_m_;
  const Eigen::Vector3f from = ((search.earth_m - corner) / unit_m).cast<float>();
  const auto reach = static_cast<float>(1.000001 * search.ChordM() / unit_m + 2.1);
  for (std::size_t i = Home(hash); slots_[i].entry != kEmpty; i = Next(i)) {
    const Slot& slot = slots_[i];
    if (slot.hash != hash) continue;
    const Eigen::Vector3f offset(slot.offset[0], slot.offset[1], slot.offset[2]);
    if ((offset - from).squaredNorm() > reach * reach) continue;
    const Entry& entry = entries_[slot.entry];
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

SpatialGrid::Offset SpatialGrid::OffsetIn(const Cell& cell, const Eigen::Vector3d& earth_m) const {
  Offset offset;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double share = earth_m[static_cast<int>(axis)] / cell_m_ - cell[axis];
    offset[axis] = static_cast<std::uint16_t>(std::min(std::max(share, 0.0) * 65536.0, 65535.0));
  }
  return offset;
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
  decltype(slots_) old(2 * slots_.size());
  old.swap(slots_);
  for (const Slot& slot : old) {
    if (slot.entry != kEmpty) PutSlot(slot);
  }
}

}  // namespace livemap::geo
