#pragma once

#include <string>

#include "geo/wgs84.h"

namespace livemap::recordings {

/// Receivers state the dilution of precision, not metres: the standard deviation per axis that one
/// unit of it stands for, as for a receiver of one frequency under open sky.
constexpr double kMetresPerHdop = 4.0;

/// The fields that all files of positions have. `where` begins the sentence of the Error that each
/// throws for a value that is none, such as "line 3 of 'a.csv'".

/// Degrees.
geo::GeoPoint ReadPosition(const std::string& latitude, const std::string& longitude,
                           const std::string& where);
/// Metres per second of a speed that is given in units of `mps_per_unit`.
double ReadSpeed(const std::string& text, double mps_per_unit, const std::string& where);
/// Degrees, 0 to 360.
double ReadCourse(const std::string& text, const std::string& where);

}  // namespace livemap::recordings
