#pragma once

#include "geo/wgs84.h"

namespace livemap::geo {

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

}  // namespace livemap::geo
