#include "change/memory/place_index.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace livemap::change {
namespace {

constexpr double kFullTurn = 6.283185307179586;
constexpr double kMinCellM = 5;

/// 0 to pi.
double HeadingDifferenceOfPlaces(double a, double b) {
  return std::abs(std::remainder(a - b, kFullTurn));
}

}  // namespace

PlaceIndex::PlaceIndex(const PlaceReach& reach)
    : reach_(reach), grid_(std::max(2 * reach.max_distance_m, kMinCellM)) {}

void PlaceIndex::Insert(std::int64_t id, const geo::GeoPoint& position, double heading_rad,
                        const std::string& drive_id) {
  const auto drive = drives_.emplace(drive_id, static_cast<std::uint32_t>(drives_.size()));
  grid_.Insert(position, static_cast<std::uint64_t>(id));
  places_[id] = {position, static_cast<float>(heading_rad), drive.first->second};
}

void PlaceIndex::Erase(std::int64_t id) {
  const auto found = places_.find(id);
  grid_.Erase(found->second.position, static_cast<std::uint64_t>(id));
  places_.erase(found);
}

std::vector<PlaceMatch> PlaceIndex::Nearest(const PlaceQuery& query) const {
  std::vector<PlaceMatch> candidates;
  if (!geo::IsValid(query.position) || !std::isfinite(query.heading_rad)) return candidates;
  const auto drive = drives_.find(query.exclude_drive);
  for (const auto& near : grid_.Within(query.position, reach_.max_distance_m)) {
    const auto id = static_cast<std::int64_t>(near.id);
    const Place& place = places_.at(id);
    if (drive != drives_.end() && place.drive == drive->second) continue;
    const double difference =
        HeadingDifferenceOfPlaces(static_cast<double>(place.heading_rad), query.heading_rad);
    if (difference > reach_.max_heading_difference_rad) continue;
    candidates.push_back({id, near.distance_m, difference});
  }
  const std::size_t count = std::min(reach_.candidates, candidates.size());
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(count),
                    candidates.end(), [](const PlaceMatch& a, const PlaceMatch& b) {
                      return std::tie(a.distance_m, a.id) < std::tie(b.distance_m, b.id);
                    });
  candidates.resize(count);
  return candidates;
}

}  // namespace livemap::change
