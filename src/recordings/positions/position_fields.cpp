#include "recordings/positions/position_fields.h"

#include <optional>

#include "common/error.h"
#include "datasets/text_parsing.h"
#include "recordings/recorded_track.h"

namespace livemap::recordings {

geo::GeoPoint ReadPosition(const std::string& latitude, const std::string& longitude,
                           const std::string& where) {
  const std::optional<double> north = datasets::ParseFinite(latitude);
  const std::optional<double> east = datasets::ParseFinite(longitude);
  if (!north || !east || !geo::IsValid({*north, *east})) {
    throw Error(where + " has the position '" + latitude.substr(0, 24) + ", " +
                longitude.substr(0, 24) +
                "', accepted are degrees, latitude -90 to 90 and longitude -180 to 180");
  }
  return {*north, *east};
}

double ReadSpeed(const std::string& text, double mps_per_unit, const std::string& where) {
  const std::optional<double> value = datasets::ParseFinite(text);
  if (!value || *value < 0 || *value * mps_per_unit > kMaxRecordedSpeedMps) {
    throw Error(where + " has the speed '" + text.substr(0, 24) +
                "', accepted is a number from 0 to " +
                std::to_string(kMaxRecordedSpeedMps / mps_per_unit));
  }
  return *value * mps_per_unit;
}

double ReadCourse(const std::string& text, const std::string& where) {
  const std::optional<double> value = datasets::ParseFinite(text);
  if (!value || *value < -180 || *value > 360) {
    throw Error(where + " has the course '" + text.substr(0, 24) +
                "', accepted are degrees clockwise from north, 0 to 360");
  }
  return *value < 0 ? *value + 360 : *value;
}

}  // namespace livemap::recordings
