#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "base/uuid.h"
#include "geo/wgs84.h"

namespace livemap {

/// A latitude-longitude rectangle, edges included. It crosses the antimeridian when its western
/// longitude exceeds its eastern one.
struct GeoBox {
  GeoPoint south_west;
  GeoPoint north_east;

  bool Contains(const GeoPoint& point) const {
    if (point.latitude_deg < south_west.latitude_deg) return false;
    if (point.latitude_deg > north_east.latitude_deg) return false;
    const bool east_of_west = point.longitude_deg >= south_west.longitude_deg;
    const bool west_of_east = point.longitude_deg <= north_east.longitude_deg;
    const bool crosses = south_west.longitude_deg > north_east.longitude_deg;
    return crosses ? east_of_west || west_of_east : east_of_west && west_of_east;
  }
};

/// One hazard on the zone's map.
struct Hazard {
  Uuid uuid;               ///< The zone's own id.
  std::string class_name;  ///< Valid printable UTF-8, at most 64 bytes.
  float confidence = 0;    ///< 0..1, of all sightings together.
  GeoPoint position;       ///< Fused from all sightings.
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Identity();  ///< East-north, of `position`.
  std::uint32_t sightings = 1;     ///< Reports merged so far, each uuid once.
  std::int64_t first_seen_ns = 0;  ///< Oldest image stamp, UTC ns since 1970.
  std::int64_t last_seen_ns = 0;   ///< Newest image stamp.
  std::int64_t updated_ns = 0;     ///< Zone clock at the last event.
  std::uint64_t sequence = 0;      ///< Of its last event.
  std::string image_sha256;        ///< 64 hex digits, or empty without a picture.
  std::string image_format;        ///< "jpeg", "png" or "webp"; empty without a picture.
  bool active = true;              ///< False once removed from the map.
};

enum class HazardAction { kAdded = 0, kUpdated = 1, kRemoved = 2 };

/// What changed on the map. `hazard.sequence` is the event's.
struct HazardEvent {
  HazardAction action = HazardAction::kAdded;
  Hazard hazard;
};

}  // namespace livemap
