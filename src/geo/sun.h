#pragma once

#include <cstdint>

#include "geo/wgs84.h"

namespace livemap::geo {

/// How high the sun's centre stands above the horizon, degrees, negative at night; without
/// refraction. To 0.1 degrees from 1950 to 2050. `time_ns`: since 1970, UTC.
/// Source: "Low precision formulas for the Sun", The Astronomical Almanac, section C.
double SunElevationDeg(const GeoPoint& place, std::int64_t time_ns);

}  // namespace livemap::geo
