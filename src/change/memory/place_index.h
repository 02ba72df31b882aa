#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include "geo/spatial_grid.h"

namespace livemap::change {

/// Where and how somebody looks now.
struct PlaceQuery {
  geo::GeoPoint position;
  double heading_rad = 0;     ///< Of the view, clockwise from true north.
  std::string exclude_drive;  ///< Frames of this drive do not count; empty: all do.
};

/// A frame that was taken near by.
struct PlaceMatch {
  std::int64_t id = 0;
  double distance_m = 0;              ///< Geodesic.
  double heading_difference_rad = 0;  ///< 0 to pi.
};

/// What counts as near.
struct PlaceReach {
  std::size_t candidates = 15;  ///< At most so many (thesis 4.3).
  double max_distance_m = 15;
  double max_heading_difference_rad = 0.5235987755982988;  ///< 30 degrees.
};

/// Frames by place and heading, in memory. The cost of a question does not grow with the number of
/// frames, only with how many lie near. Not thread-safe.
class PlaceIndex {
 public:
  explicit PlaceIndex(const PlaceReach& reach);

  /// `position` valid, `id` new.
  void Insert(std::int64_t id, const geo::GeoPoint& position, double heading_rad,
              const std::string& drive_id);
  /// `id` must be there.
  void Erase(std::int64_t id);
  /// The nearest frames within reach, the nearest first; exact by geodesic distance, the lower id
  /// among equals. None for an invalid query.
  std::vector<PlaceMatch> Nearest(const PlaceQuery& query) const;

  std::size_t size() const { return places_.size(); }

 private:
  struct Place {
    geo::GeoPoint position;
    float heading_rad;
    std::uint32_t drive;  ///< Number of its id.
  };

  PlaceReach reach_;
  geo::SpatialGrid grid_;
  std::unordered_map<std::int64_t, Place> places_;
  std::unordered_map<std::string, std::uint32_t> drives_;
};

}  // namespace livemap::change
