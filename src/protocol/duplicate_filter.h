#pragma once

#include <map>
#include <optional>
#include <string>
#include <unordered_map>

#include "common/uuid.h"
#include "geo/spatial_grid.h"
#include "geo/wgs84.h"
#include "protocol/hazard_catalogue.h"

namespace livemap::protocol {

/// Knows where hazards are and says whether a sighting is one of them: the same class within the
/// class's duplicate radius, as the geodesic measures it (thesis, section 3.1). The cost of every
/// operation is independent of the number of known hazards. Not thread-safe.
class DuplicateFilter {
 public:
  struct Match {
    Uuid id;
    double distance_m;
  };

  explicit DuplicateFilter(HazardCatalogue catalogue);

  /// Adds a hazard, or moves the one that has this id. Throws Error for an invalid position.
  void Put(const Uuid& id, const std::string& class_name, const geo::GeoPoint& position);
  /// Forgets a hazard; false when it was not known.
  bool Remove(const Uuid& id);
  /// The nearest known hazard that a sighting of this class at this place duplicates.
  std::optional<Match> Find(const std::string& class_name, const geo::GeoPoint& position) const;

  bool Knows(const Uuid& id) const { return numbers_.count(id) != 0; }
  std::size_t size() const { return numbers_.size(); }

 private:
  struct ClassIndex {
    double radius_m;
    geo::SpatialGrid grid;
  };
  using ClassMap = std::map<std::string, ClassIndex>;
  struct Known {
    Uuid id;
    geo::GeoPoint position;
    ClassMap::iterator index;
  };

  ClassMap::iterator IndexOf(const std::string& class_name);

  HazardCatalogue catalogue_;
  ClassMap classes_;  // Only classes of which a hazard is known.
  // The grid speaks of hazards by number: their place in known_; free numbers are used again.
  std::vector<Known> known_;
  std::vector<std::uint64_t> free_numbers_;
  std::unordered_map<Uuid, std::uint64_t> numbers_;
};

}  // namespace livemap::protocol
