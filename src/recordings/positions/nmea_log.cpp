#include "recordings/positions/nmea_log.h"

#include <cmath>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "common/error.h"
#include "common/text_file.h"
#include "datasets/text_parsing.h"
#include "recordings/positions/position_fields.h"
#include "recordings/time_text.h"

namespace livemap::recordings {
namespace {

constexpr std::int64_t kNmeaSecondNs = 1'000'000'000;
constexpr std::int64_t kNmeaDayNs = 86'400 * kNmeaSecondNs;
constexpr double kMpsPerKnot = 1852.0 / 3600;

/// A sentence's fields, the address first; none where its checksum is missing or wrong.
std::optional<std::vector<std::string>> SentenceFields(std::string_view line) {
  const std::size_t star = line.find('*');
  if (star == std::string_view::npos || star + 3 > line.size()) return std::nullopt;
  unsigned int sum = 0;
  for (const char c : line.substr(1, star - 1)) sum ^= static_cast<unsigned char>(c);
  unsigned int stated = 0;
  for (const char c : line.substr(star + 1, 2)) {
    const bool digit = c >= '0' && c <= '9';
    const char lower = static_cast<char>(c | 0x20);
    if (!digit && (lower < 'a' || lower > 'f')) return std::nullopt;
    stated = stated * 16 + static_cast<unsigned int>(digit ? c - '0' : lower - 'a' + 10);
  }
  if (sum != stated) return std::nullopt;
  return datasets::Split(std::string(line.substr(1, star - 1)), ',');
}

/// What the sentences of one time of day say.
struct NmeaEpoch {
  std::int64_t time_of_day_ns = 0;
  std::optional<std::int64_t> day_ns;
  std::optional<geo::GeoPoint> place;
  bool invalid = false;  ///< A sentence says so.
  RecordedPosition position;
};

class NmeaLog {
 public:
  explicit NmeaLog(std::string name) : name_(std::move(name)) {}

  void Read(const std::string& text, std::size_t line) {
    const std::size_t dollar = text.find('$');
    if (dollar == std::string::npos) return;
    const auto fields = SentenceFields(std::string_view(text).substr(dollar));
    if (!fields) return corrupt_.Count(line);
    ++valid_;
    line_ = line;
    const std::string& address = fields->front();
    if (address.size() != 5 || address[0] == 'P') return;
    const std::string kind = address.substr(2);
    if (kind == "RMC") TakeRmc(*fields);
    if (kind == "GGA") TakeGga(*fields);
    if (kind == "GST") TakeGst(*fields);
    if (kind == "VTG") TakeVtg(*fields);
    if (kind == "ZDA") TakeZda(*fields);
  }

  RecordedTrack Finish() {
    Close();
    if (valid_ == 0 && corrupt_.count() == 0) {
      throw Error("'" + name_ + "' has no NMEA sentence, accepted are lines like $GPRMC,...*5A");
    }
    if (corrupt_.count() > valid_) {
      throw Error("'" + name_ + "' has " + std::to_string(corrupt_.count()) +
                  " sentences without a valid checksum, the first in line " +
                  std::to_string(corrupt_.first_line()) + ", and only " + std::to_string(valid_) +
                  " valid ones");
    }
    if (positions_.empty() && dateless_.count() > 0) {
      throw Error("'" + name_ + "' has no date, the first position is line " +
                  std::to_string(dateless_.first_line()) + ": accepted are RMC or ZDA sentences");
    }
    std::vector<std::string> notes;
    corrupt_.Tell(name_, notes);
    fixless_.Tell(name_, notes);
    dateless_.Tell(name_, notes);
    return OrderTrack(std::move(positions_), std::move(notes), name_);
  }

 private:
  std::string Where() const { return "line " + std::to_string(line_) + " of '" + name_ + "'"; }

  [[noreturn]] void Refuse(const std::string& what, const std::string& value,
                           const std::string& accepted) const {
    throw Error(Where() + " has the " + what + " '" + value.substr(0, 24) + "', accepted is " +
                accepted);
  }

  /// Empty where the sentence is shorter.
  static std::string At(const std::vector<std::string>& fields, std::size_t index) {
    return index < fields.size() ? fields[index] : "";
  }

  /// The number that `count` digits of `text` from `at` on are, at most 4; none where they are no
  /// digits.
  static std::optional<int> DigitsAt(const std::string& text, std::size_t at, std::size_t count) {
    if (at + count > text.size() || count > 4) return std::nullopt;
    int value = 0;
    for (const char c : text.substr(at, count)) {
      if (c < '0' || c > '9') return std::nullopt;
      value = value * 10 + (c - '0');
    }
    return value;
  }

  /// Begins the epoch of a sentence, if it is another. False where the sentence has no time.
  bool Open(const std::string& time) {
    if (time.empty()) return false;
    const auto hour = DigitsAt(time, 0, 2), minute = DigitsAt(time, 2, 2);
    const auto second = datasets::ParseFinite(time.substr(std::min<std::size_t>(4, time.size())));
    if (!hour || !minute || !second || *hour > 23 || *minute > 59 || *second < 0 || *second >= 61) {
      Refuse("time", time, "hhmmss.sss");
    }
    const std::int64_t time_of_day_ns =
        (*hour * 3600 + *minute * 60) * kNmeaSecondNs + std::llround(*second * 1e9);
    if (epoch_ && epoch_->time_of_day_ns == time_of_day_ns) return true;
    Close();
    epoch_.emplace();
    epoch_->time_of_day_ns = time_of_day_ns;
    epoch_->position.line = line_;
    return true;
  }

  /// What the epoch says becomes a position.
  void Close() {
    if (!epoch_) return;
    const NmeaEpoch epoch = *std::exchange(epoch_, std::nullopt);
    if (epoch.day_ns) {
      day_ns_ = epoch.day_ns;
    } else if (day_ns_ && epoch.time_of_day_ns + kNmeaDayNs / 2 < last_time_of_day_ns_) {
      *day_ns_ += kNmeaDayNs;
    }
    last_time_of_day_ns_ = epoch.time_of_day_ns;
    if (epoch.invalid || !epoch.place) {
      if (epoch.invalid) fixless_.Count(epoch.position.line);
      return;
    }
    if (!day_ns_) return dateless_.Count(epoch.position.line);
    RecordedPosition position = epoch.position;
    position.position = *epoch.place;
    position.stamp_ns = *day_ns_ + epoch.time_of_day_ns;
    positions_.push_back(position);
  }

  /// Degrees of "4807.038","N".
  double Angle(const std::string& text, const std::string& side, const char* sides) const {
    const std::size_t point = std::min(text.find('.'), text.size());
    const std::size_t degree_digits = point >= 2 ? point - 2 : 0;
    const auto degrees = DigitsAt(text, 0, degree_digits);
    const auto minutes = datasets::ParseFinite(text.substr(degree_digits));
    const bool known_side = side.size() == 1 && (side[0] == sides[0] || side[0] == sides[1]);
    if (!degrees || degree_digits == 0 || degree_digits > 3 || !minutes || *minutes < 0 ||
        *minutes >= 60 || !known_side) {
      Refuse("coordinate", text + "," + side, std::string("dddmm.mmmm,") + sides[0]);
    }
    const double angle = *degrees + *minutes / 60;
    return side[0] == sides[1] ? -angle : angle;
  }

  void TakePlace(const std::vector<std::string>& fields, std::size_t at) {
    if (At(fields, at).empty() && At(fields, at + 2).empty()) return;
    const geo::GeoPoint place{Angle(At(fields, at), At(fields, at + 1), "NS"),
                              Angle(At(fields, at + 2), At(fields, at + 3), "EW")};
    if (!geo::IsValid(place)) {
      Refuse("coordinate", At(fields, at) + "," + At(fields, at + 2), "a place on the earth");
    }
    epoch_->place = place;
  }

  void TakeDay(std::optional<int> year, std::optional<int> month, std::optional<int> day,
               const std::string& text) {
    const auto midnight = year && month && day ? StampOfDay(*year, *month, *day) : std::nullopt;
    if (!midnight) Refuse("date", text, "a day of 1980 to 2079");
    epoch_->day_ns = midnight;
  }

  /// $--RMC,time,status,lat,N,lon,E,knots,course,ddmmyy,...
  void TakeRmc(const std::vector<std::string>& fields) {
    if (!Open(At(fields, 1))) return;
    if (const std::string date = At(fields, 9); !date.empty()) {
      std::optional<int> year = DigitsAt(date, 4, 2);
      if (year) *year += *year < 80 ? 2000 : 1900;
      TakeDay(date.size() == 6 ? year : std::nullopt, DigitsAt(date, 2, 2), DigitsAt(date, 0, 2),
              date);
    }
    if (At(fields, 2) != "A") {
      epoch_->invalid = true;
      return;
    }
    TakePlace(fields, 3);
    if (!At(fields, 7).empty()) {
      epoch_->position.speed_mps = ReadSpeed(fields[7], kMpsPerKnot, Where());
    }
    if (!At(fields, 8).empty()) epoch_->position.course_deg = ReadCourse(fields[8], Where());
  }

  /// $--GGA,time,lat,N,lon,E,quality,satellites,hdop,altitude,M,...
  void TakeGga(const std::vector<std::string>& fields) {
    if (!Open(At(fields, 1))) return;
    const std::string quality = At(fields, 6);
    // 0: none; 7: typed in; 8: made up.
    if (quality.empty() || quality == "0" || quality == "7" || quality == "8") {
      epoch_->invalid = true;
      return;
    }
    TakePlace(fields, 2);
    const auto hdop = datasets::ParseFinite(At(fields, 8));
    if (hdop && *hdop > 0 && *hdop < 100 && !epoch_->position.sigma_m) {
      epoch_->position.sigma_m = *hdop * kMetresPerHdop;
    }
    const auto altitude = datasets::ParseFinite(At(fields, 9));
    if (altitude && std::abs(*altitude) < 20000) epoch_->position.altitude_m = altitude;
  }

  /// $--GST,time,rms,major,minor,orientation,latitude,longitude,altitude
  void TakeGst(const std::vector<std::string>& fields) {
    if (!Open(At(fields, 1))) return;
    const auto north = datasets::ParseFinite(At(fields, 6));
    const auto east = datasets::ParseFinite(At(fields, 7));
    if (!north || !east || *north <= 0 || *east <= 0 || *north > 1e4 || *east > 1e4) return;
    epoch_->position.sigma_m = std::sqrt((*north * *north + *east * *east) / 2);
  }

  /// $--VTG,course,T,magnetic,M,knots,N,kmh,K: no time, it belongs to the sentences around it.
  void TakeVtg(const std::vector<std::string>& fields) {
    if (!epoch_) return;
    if (!epoch_->position.course_deg && !At(fields, 1).empty() && At(fields, 2) == "T") {
      epoch_->position.course_deg = ReadCourse(fields[1], Where());
    }
    if (!epoch_->position.speed_mps && !At(fields, 5).empty() && At(fields, 6) == "N") {
      epoch_->position.speed_mps = ReadSpeed(fields[5], kMpsPerKnot, Where());
    }
  }

  /// $--ZDA,time,dd,mm,yyyy,...
  void TakeZda(const std::vector<std::string>& fields) {
    if (!Open(At(fields, 1)) || At(fields, 4).empty()) return;
    TakeDay(DigitsAt(fields[4], 0, 4), DigitsAt(fields[3], 0, 2), DigitsAt(fields[2], 0, 2),
            fields[2] + "." + fields[3] + "." + fields[4]);
  }

  const std::string name_;
  std::size_t line_ = 0;
  std::size_t valid_ = 0;
  std::optional<NmeaEpoch> epoch_;
  std::optional<std::int64_t> day_ns_;
  std::int64_t last_time_of_day_ns_ = 0;
  std::vector<RecordedPosition> positions_;
  LeftOut corrupt_{"sentences without a valid checksum, left out"};
  LeftOut fixless_{"positions that the receiver calls invalid, left out"};
  LeftOut dateless_{"positions before the first date, left out"};
};

}  // namespace

RecordedTrack ParseNmea(const std::string& text, const std::string& name) {
  NmeaLog log(name);
  const std::vector<std::string> lines = datasets::Lines(text);
  for (std::size_t i = 0; i < lines.size(); ++i) log.Read(lines[i], i + 1);
  return log.Finish();
}

RecordedTrack ReadNmea(const std::string& path) {
  return ParseNmea(ReadTextFile(path, datasets::kMaxTextBytes), path);
}

}  // namespace livemap::recordings
