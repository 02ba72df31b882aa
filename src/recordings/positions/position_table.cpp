#include "recordings/positions/position_table.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <string_view>
#include <utility>

#include "common/error.h"
#include "common/text_file.h"
#include "common/time.h"
#include "datasets/text_parsing.h"
#include "recordings/positions/position_fields.h"
#include "recordings/time_text.h"

namespace livemap::recordings {
namespace {

enum class Column { kTime, kLatitude, kLongitude, kAltitude, kSpeed, kCourse, kSigma, kCount };

struct ColumnName {
  std::string_view name;
  Column column;
  double unit = 1;  ///< What one of it is in m/s or m.
};

/// 68 % of a circle's radius to the standard deviation per axis: sqrt(-2 ln(1 - 0.68)).
constexpr double kSigmaOfAccuracy = 1 / 1.51;

constexpr ColumnName kColumnNames[] = {
    {"time", Column::kTime},
    {"timestamp", Column::kTime},
    {"datetime", Column::kTime},
    {"date_time", Column::kTime},
    {"utc", Column::kTime},
    {"utc_time", Column::kTime},
    {"stamp", Column::kTime},
    {"time_s", Column::kTime},
    {"lat", Column::kLatitude},
    {"latitude", Column::kLatitude},
    {"latitude_deg", Column::kLatitude},
    {"lon", Column::kLongitude},
    {"lng", Column::kLongitude},
    {"long", Column::kLongitude},
    {"longitude", Column::kLongitude},
    {"longitude_deg", Column::kLongitude},
    {"alt", Column::kAltitude},
    {"altitude", Column::kAltitude},
    {"altitude_m", Column::kAltitude},
    {"ele", Column::kAltitude},
    {"elevation", Column::kAltitude},
    {"speed_mps", Column::kSpeed},
    {"speed(m/s)", Column::kSpeed},
    {"speed_kmh", Column::kSpeed, 1 / 3.6},
    {"speed(km/h)", Column::kSpeed, 1 / 3.6},
    {"speed_mph", Column::kSpeed, 0.44704},
    {"speed(mph)", Column::kSpeed, 0.44704},
    {"speed_knots", Column::kSpeed, 1852.0 / 3600},
    {"course", Column::kCourse},
    {"course_deg", Column::kCourse},
    {"heading", Column::kCourse},
    {"bearing", Column::kCourse},
    {"track", Column::kCourse},
    {"sigma_m", Column::kSigma},
    {"accuracy", Column::kSigma, kSigmaOfAccuracy},
    {"accuracy_m", Column::kSigma, kSigmaOfAccuracy},
    {"hacc", Column::kSigma, kSigmaOfAccuracy},
};

std::string Normalised(const std::string& field) {
  std::string name;
  for (const char c : field) {
    if (c == '"' || c == '\'') continue;
    name += c == ' ' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  const std::size_t begin = name.find_first_not_of('_');
  if (begin == std::string::npos) return "";
  return name.substr(begin, name.find_last_not_of('_') + 1 - begin);
}

class PositionTable {
 public:
  PositionTable(const std::string& header, std::optional<int> zone_s, std::string name)
      : name_(std::move(name)), zone_s_(zone_s), separator_(SeparatorOf(header)) {
    const std::vector<std::string> names = datasets::Split(header, separator_);
    for (std::size_t i = 0; i < names.size(); ++i) Take(Normalised(names[i]), i);
    for (const Column needed : {Column::kTime, Column::kLatitude, Column::kLongitude}) {
      if (Place(needed).found) continue;
      throw Error("line 1 of '" + name_ + "' is '" + header.substr(0, 80) +
                  "', accepted are column names with time, latitude and longitude");
    }
  }

  void ReadLine(const std::string& text, std::size_t line) {
    const std::vector<std::string> fields = datasets::Split(text, separator_);
    const std::string where = "line " + std::to_string(line) + " of '" + name_ + "'";
    const std::string time = Field(fields, Column::kTime);
    const std::string latitude = Field(fields, Column::kLatitude);
    const std::string longitude = Field(fields, Column::kLongitude);
    if (time.empty()) return timeless_.Count(line);
    if (latitude.empty() && longitude.empty()) return placeless_.Count(line);
    RecordedPosition position;
    position.line = line;
    position.stamp_ns = ReadTime(time, where);
    position.position = ReadPosition(latitude, longitude, where);
    if (const std::string text_of = Field(fields, Column::kAltitude); !text_of.empty()) {
      position.altitude_m = Bounded(text_of, "altitude", -1000, 20000, where);
    }
    if (const std::string text_of = Field(fields, Column::kSpeed); !text_of.empty()) {
      position.speed_mps = ReadSpeed(text_of, Place(Column::kSpeed).unit, where);
    }
    if (const std::string text_of = Field(fields, Column::kCourse); !text_of.empty()) {
      position.course_deg = ReadCourse(text_of, where);
    }
    if (const std::string text_of = Field(fields, Column::kSigma); !text_of.empty()) {
      const double stated = Bounded(text_of, "accuracy", 0, 1e5, where);
      if (stated > 0) position.sigma_m = stated * Place(Column::kSigma).unit;
    }
    positions_.push_back(position);
  }

  RecordedTrack Finish() {
    std::vector<std::string> notes;
    timeless_.Tell(name_, notes);
    placeless_.Tell(name_, notes);
    return OrderTrack(std::move(positions_), std::move(notes), name_);
  }

 private:
  struct ColumnPlace {
    bool found = false;
    std::size_t index = 0;
    double unit = 1;
  };

  /// The one that stands most often in the header.
  static char SeparatorOf(const std::string& header) {
    char best = ',';
    for (const char separator : {';', '\t'}) {
      if (std::count(header.begin(), header.end(), separator) >
          std::count(header.begin(), header.end(), best)) {
        best = separator;
      }
    }
    return best;
  }

  ColumnPlace& Place(Column column) { return places_[static_cast<std::size_t>(column)]; }

  void Take(const std::string& field, std::size_t index) {
    for (const ColumnName& known : kColumnNames) {
      if (known.name != field || Place(known.column).found) continue;
      Place(known.column) = {true, index, known.unit};
    }
  }

  /// Empty where the column or the line's field is none.
  std::string Field(const std::vector<std::string>& fields, Column column) {
    const ColumnPlace& place = Place(column);
    if (!place.found || place.index >= fields.size()) return "";
    std::string text;
    for (const char c : fields[place.index]) {
      if (c != '"') text += c == ',' && separator_ != ',' ? '.' : c;
    }
    const std::size_t begin = text.find_first_not_of(" \t\r");
    if (begin == std::string::npos) return "";
    return text.substr(begin, text.find_last_not_of(" \t\r") + 1 - begin);
  }

  std::int64_t ReadTime(const std::string& text, const std::string& where) const {
    if (const std::optional<double> number = datasets::ParseFinite(text)) {
      // By its size: since 1970 there are 1e9 s and more.
      const double unit_s = *number < 1e11   ? 1
                            : *number < 1e14 ? 1e-3
                            : *number < 1e17 ? 1e-6
                                             : 1e-9;
      const double seconds = *number * unit_s;
      if (seconds >= 315532800 && seconds < 4e9) return Nanoseconds(seconds);
    } else if (const std::optional<TimeText> time = ParseTimeText(text)) {
      if (time->has_zone) return time->stamp_ns;
      if (zone_s_) return time->stamp_ns - std::int64_t{*zone_s_} * 1'000'000'000;
      throw Error(where + " has the time '" + text.substr(0, 40) +
                  "' without a zone: --time-zone says which, such as +02:00");
    }
    throw Error(where + " has the time '" + text.substr(0, 40) +
                "', accepted is 2026-01-31T12:34:56Z, or seconds since 1970");
  }

  static double Bounded(const std::string& text, const char* what, double min, double max,
                        const std::string& where) {
    const std::optional<double> value = datasets::ParseFinite(text);
    if (value && *value >= min && *value <= max) return *value;
    throw Error(where + " has the " + what + " '" + text.substr(0, 24) +
                "', accepted is a number from " + std::to_string(min) + " to " +
                std::to_string(max));
  }

  const std::string name_;
  const std::optional<int> zone_s_;
  const char separator_;
  std::array<ColumnPlace, static_cast<std::size_t>(Column::kCount)> places_;
  std::vector<RecordedPosition> positions_;
  LeftOut timeless_{"lines without a time, left out"};
  LeftOut placeless_{"lines without a position, left out"};
};

}  // namespace

RecordedTrack ParsePositionTable(const std::string& text, std::optional<int> zone_s,
                                 const std::string& name) {
  const std::vector<std::string> lines = datasets::Lines(text);
  if (lines.empty()) throw Error("'" + name + "' is empty, accepted is a table of positions");
  PositionTable table(lines[0], zone_s, name);
  for (std::size_t i = 1; i < lines.size(); ++i) {
    if (!lines[i].empty()) table.ReadLine(lines[i], i + 1);
  }
  return table.Finish();
}

RecordedTrack ReadPositionTable(const std::string& path, std::optional<int> zone_s) {
  return ParsePositionTable(ReadTextFile(path, datasets::kMaxTextBytes), zone_s, path);
}

}  // namespace livemap::recordings
