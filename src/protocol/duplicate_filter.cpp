#include "protocol/duplicate_filter.h"

#include <utility>

#include "common/error.h"

namespace livemap::protocol {
DuplicateFilter::DuplicateFilter(HazardCatalogue catalogue) : catalogue_(std::move(catalogue)) {}

void DuplicateFilter::Put(const Uuid& id, const std::string& class_name,
                          const geo::GeoPoint& position) {
  if (!geo::IsValid(position)) throw Error("hazard " + id.ToString() + " has no valid position");
  Remove(id);
  std::uint64_t number = known_.size();
  if (free_numbers_.empty()) {
    known_.emplace_back();
  } else {
    number = free_numbers_.back();
    free_numbers_.pop_back();
  }
  const auto index = IndexOf(class_name);
  index->second.grid.Insert(position, number);
  known_[number] = {id, position, index};
  numbers_[id] = number;
}

bool DuplicateFilter::Remove(const Uuid& id) {
  const auto found = numbers_.find(id);
  if (found == numbers_.end()) return false;
  const Known& known = known_[found->second];
  known.index->second.grid.Erase(known.position, found->second);
  if (known.index->second.grid.size() == 0) classes_.erase(known.index);
  free_numbers_.push_back(found->second);
  numbers_.erase(found);
  return true;
}

std::optional<DuplicateFilter::Match> DuplicateFilter::Find(const std::string& class_name,
                                                            const geo::GeoPoint& position) const {
  const auto found = classes_.find(class_name);
  if (found == classes_.end()) return std::nullopt;
  const auto nearest = found->second.grid.Nearest(position, found->second.radius_m);
  if (!nearest) return std::nullopt;
  return Match{known_[nearest->id].id, nearest->distance_m};
}

DuplicateFilter::ClassMap::iterator DuplicateFilter::IndexOf(const std::string& class_name) {
  const auto found = classes_.find(class_name);
  if (found != classes_.end()) return found;
  const double radius_m = catalogue_.DuplicateRadiusM(class_name);
  return classes_.emplace(class_name, ClassIndex{radius_m, geo::SpatialGrid::ForRadius(radius_m)})
      .first;
}

}  // namespace livemap::protocol
