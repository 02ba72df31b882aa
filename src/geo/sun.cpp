#include "geo/sun.h"

#include <cmath>

namespace livemap::geo {

double SunElevationDeg(const GeoPoint& place, std::int64_t time_ns) {
  constexpr double kNsPerDay = 86400e9;
  constexpr double kDaysTo2000 = 10957.5;  // From 1970 to 2000-01-01 12:00.
  const double days = static_cast<double>(time_ns) / kNsPerDay - kDaysTo2000;
  const double anomaly = (357.528 + 0.9856003 * days) * kRadiansPerDegree;
  const double longitude =
      (280.460 + 0.9856474 * days + 1.915 * std::sin(anomaly) + 0.020 * std::sin(2 * anomaly)) *
      kRadiansPerDegree;
  const double obliquity = (23.439 - 4e-7 * days) * kRadiansPerDegree;
  const double right_ascension =
      std::atan2(std::cos(obliquity) * std::sin(longitude), std::cos(longitude));
  const double declination = std::asin(std::sin(obliquity) * std::sin(longitude));
  const double sidereal_deg = 280.46062 + 360.98564737 * days + place.longitude_deg;
  const double hour_angle = std::fmod(sidereal_deg, 360.0) * kRadiansPerDegree - right_ascension;
  const double latitude = place.latitude_deg * kRadiansPerDegree;
  return std::asin(std::sin(latitude) * std::sin(declination) +
                   std::cos(latitude) * std::cos(declination) * std::cos(hour_angle)) /
         kRadiansPerDegree;
}

}  // namespace livemap::geo
