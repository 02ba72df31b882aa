#include "zone/hazard_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace livemap {
namespace {

constexpr double kRadiansPerE7 = 3.14159265358979323846 / 180.0 * 1e-7;
/// WGS84: metres per 1e-7 degree of latitude are least at the equator, a (1 - e^2) pi / 180e7;
/// rounded down.
constexpr double kMetresPerLatitudeE7 = 0.0110574;
/// WGS84: the parallel at latitude phi has at least the radius a cos(phi); rounded down.
constexpr double kMetresPerLongitudeE7 = 0.0111319;
constexpr std::int64_t kPoleE7 = 900'000'000;

double CosineE7(std::int64_t latitude_e7) {
  if (std::abs(latitude_e7) >= kPoleE7) return 0;
  return std::cos(static_cast<double>(latitude_e7) * kRadiansPerE7);
}

std::uint64_t Mixed(std::uint64_t value) {  // The finaliser of splitmix64.
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9U;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebU;
  return value ^ (value >> 31);
}

}  // namespace

HazardGrid::HazardGrid(double radius_m, std::uint64_t hash_seed)
    : radius_m_(radius_m),
      hash_seed_(hash_seed),
      band_height_e7_(static_cast<std::int64_t>(std::ceil(2 * radius_m / kMetresPerLatitudeE7))),
      table_(16) {}

std::int64_t HazardGrid::Band(std::int64_t latitude_e7) const {
  return (std::clamp(latitude_e7, -kPoleE7, kPoleE7) + kPoleE7) / band_height_e7_;
}

std::int64_t HazardGrid::Columns(std::int64_t band) const {
  const std::int64_t south = band * band_height_e7_ - kPoleE7;
  const std::int64_t poleward = std::max(std::abs(south), std::abs(south + band_height_e7_));
  const double length_m = static_cast<double>(kTurn) * kMetresPerLongitudeE7 * CosineE7(poleward);
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(length_m / (2 * radius_m_)));
}

std::uint64_t HazardGrid::Cell(const GeoPointE7& position) const {
  const std::int64_t band = Band(position.latitude_e7);
  const std::int64_t longitude = (position.longitude_e7 + kHalfTurn) % kTurn;
  const std::int64_t column = longitude * Columns(band) / kTurn;
  return static_cast<std::uint64_t>(band) << 32 | static_cast<std::uint64_t>(column);
}

std::size_t HazardGrid::Home(std::uint64_t cell) const {
  return static_cast<std::size_t>(Mixed(cell ^ hash_seed_)) & (table_.size() - 1);
}

HazardGrid::Search HazardGrid::SearchAround(const GeoPointE7& position) const {
  const auto half_height =
      static_cast<std::int64_t>(std::ceil(radius_m_ / kMetresPerLatitudeE7)) + 2;
  Search search;
  search.latitude_e7 = position.latitude_e7;
  search.longitude_e7 = (position.longitude_e7 + kHalfTurn) % kTurn;
  search.first_band = Band(search.latitude_e7 - half_height);
  search.last_band = Band(search.latitude_e7 + half_height);
  // A geodesic no longer than the radius stays between these latitudes, where a step in longitude
  // is at least as long as at the poleward one.
  search.metres_per_longitude_e7 =
      kMetresPerLongitudeE7 * CosineE7(std::abs(search.latitude_e7) + half_height);
  const double half_width = radius_m_ / search.metres_per_longitude_e7 + 2;
  search.half_width_e7 = half_width < static_cast<double>(kHalfTurn)
                             ? static_cast<std::int64_t>(std::ceil(half_width))
                             : kHalfTurn;
  return search;
}

double HazardGrid::LeastDistanceM(const Search& search, const GeoPointE7& position) const {
  const std::int64_t longitude = (position.longitude_e7 + kHalfTurn) % kTurn;
  std::int64_t difference = std::abs(longitude - search.longitude_e7);
  difference = std::min(difference, kTurn - difference);
  const double north_m =
      static_cast<double>(search.latitude_e7 - position.latitude_e7) * kMetresPerLatitudeE7;
  const double east_m = static_cast<double>(difference) * search.metres_per_longitude_e7;
  return std::sqrt(north_m * north_m + east_m * east_m);
}

void HazardGrid::Place(const Entry& entry) {
  const std::size_t mask = table_.size() - 1;
  std::size_t i = Home(entry.cell);
  while (table_[i].cell != kFree) i = (i + 1) & mask;
  table_[i] = entry;
}

void HazardGrid::Grow() {
  std::vector<Entry> old(table_.size() * 2);
  old.swap(table_);
  for (const Entry& entry : old) {
    if (entry.cell != kFree) Place(entry);
  }
}

void HazardGrid::Insert(const GeoPoint& position, Slot slot) {
  if (2 * (size_ + 1) > table_.size()) Grow();
  const GeoPointE7 rounded = ToE7(position);
  Place({Cell(rounded), rounded, slot});
  ++size_;
}

void HazardGrid::Erase(const GeoPoint& position, Slot slot) {
  const std::uint64_t cell = Cell(ToE7(position));
  const std::size_t mask = table_.size() - 1;
  std::size_t hole = Home(cell);
  while (table_[hole].cell != cell || table_[hole].slot != slot) {
    if (table_[hole].cell == kFree) return;
    hole = (hole + 1) & mask;
  }
  // Close the gap: an entry may move into the hole unless its home lies behind the hole.
  for (std::size_t i = (hole + 1) & mask; table_[i].cell != kFree; i = (i + 1) & mask) {
    const std::size_t home = Home(table_[i].cell);
    if (((i - home) & mask) < ((i - hole) & mask)) continue;
    table_[hole] = table_[i];
    hole = i;
  }
  table_[hole] = Entry{};
  --size_;
}

}  // namespace livemap
