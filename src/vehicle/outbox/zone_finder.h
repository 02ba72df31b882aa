#pragma once

#include <functional>
#include <string>

#include "geo/wgs84.h"

namespace livemap::vehicle {

/// How the vehicle's parts ask whose a place is, where zones have a directory. Empty functions:
/// there is none, and all belongs to the configured zone.
struct ZoneFinder {
  /// The id of the zone in which a place lies; empty: the configured one's.
  std::function<std::string(const geo::GeoPoint&)> zone_at;
  /// Whether the zone with this id exists no longer: nobody there will answer.
  std::function<bool(const std::string&)> is_gone;
  /// Whether a place is none of the business of the zone with this id, which may be empty for the
  /// configured one: it lies in another zone, and not near the border.
  std::function<bool(const std::string&, const geo::GeoPoint&)> is_beyond;

  /// The zone to which what lies at `place` and was for `zone` is to go now.
  std::string Redirect(const std::string& zone, const geo::GeoPoint& place) const {
    return is_gone && is_gone(zone) ? zone_at(place) : zone;
  }
};

}  // namespace livemap::vehicle
