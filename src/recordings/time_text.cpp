#include "recordings/time_text.h"

#include <array>
#include <cstdio>
#include <vector>

namespace livemap::recordings {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kDayS = 86'400;
constexpr int kMaxZoneS = 15 * 3600;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

/// Takes a text from its beginning, piece by piece; what does not fit leaves it failed.
class TextCursor {
 public:
  explicit TextCursor(std::string_view text) : rest_(text) {}

  bool ok() const { return ok_; }
  bool at_end() const { return rest_.empty(); }
  /// Exactly `count` digits.
  int Digits(std::size_t count) {
    int value = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (rest_.size() <= i || !IsDigit(rest_[i])) {
        ok_ = false;
        return 0;
      }
      value = value * 10 + (rest_[i] - '0');
    }
    rest_.remove_prefix(count);
    return value;
  }
  /// One character of `accepted`, if it comes next.
  std::optional<char> Maybe(std::string_view accepted) {
    if (rest_.empty() || accepted.find(rest_.front()) == std::string_view::npos) {
      return std::nullopt;
    }
    const char taken = rest_.front();
    rest_.remove_prefix(1);
    return taken;
  }
  /// Nanoseconds of ".789"; 0 where no fraction comes.
  std::int64_t Fraction() {
    if (!Maybe(".,")) return 0;
    std::int64_t value = 0, unit = kSecondNs;
    std::size_t digits = 0;
    for (; digits < rest_.size() && IsDigit(rest_[digits]); ++digits) {
      unit /= 10;
      value += unit * (rest_[digits] - '0');
    }
    ok_ = ok_ && digits > 0;
    rest_.remove_prefix(digits);
    return value;
  }
  bool TwoDigitsNext() const { return rest_.size() >= 2 && IsDigit(rest_[0]) && IsDigit(rest_[1]); }

 private:
  std::string_view rest_;
  bool ok_ = true;
};

/// Days from 1970-01-01 to a day of the Gregorian calendar (H. Hinnant, "chrono-Compatible
/// Low-Level Date Algorithms", days_from_civil).
std::int64_t DaysSince1970(int year, int month, int day) {
  const int shifted = month <= 2 ? year - 1 : year;
  const int era = shifted / 400, year_of_era = shifted - era * 400;
  const int day_of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
  const int day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
  return std::int64_t{era} * 146097 + day_of_era - 719468;
}

int DaysOfMonth(int year, int month) {
  constexpr std::array<int, 12> kDays = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  const bool leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
  return month == 2 && leap ? 29 : kDays[static_cast<std::size_t>(month - 1)];
}

/// Seconds of "+02:00" after its sign.
int TakeZone(TextCursor& cursor, char sign) {
  const int hours = cursor.Digits(2);
  cursor.Maybe(":");
  const int minutes = cursor.TwoDigitsNext() ? cursor.Digits(2) : 0;
  const int seconds = hours * 3600 + minutes * 60;
  return sign == '-' ? -seconds : seconds;
}

}  // namespace

std::optional<std::int64_t> StampOfDay(int year, int month, int day) {
  if (year < 1980 || year > 2105 || month < 1 || month > 12) return std::nullopt;
  if (day < 1 || day > DaysOfMonth(year, month)) return std::nullopt;
  return DaysSince1970(year, month, day) * kDayS * kSecondNs;
}

std::optional<TimeText> ParseTimeText(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  TextCursor cursor(text);
  const int year = cursor.Digits(4);
  cursor.Maybe("-:/.");
  const int month = cursor.Digits(2);
  cursor.Maybe("-:/.");
  const int day = cursor.Digits(2);
  if (!cursor.Maybe("Tt _")) return std::nullopt;
  const int hour = cursor.Digits(2);
  cursor.Maybe(":");
  const int minute = cursor.Digits(2);
  cursor.Maybe(":");
  const int second = cursor.Digits(2);
  const std::int64_t fraction_ns = cursor.Fraction();
  const std::optional<std::int64_t> midnight = StampOfDay(year, month, day);
  if (!cursor.ok() || !midnight || hour > 23 || minute > 59 || second > 60) return std::nullopt;
  TimeText time;
  time.stamp_ns = *midnight + (hour * 3600 + minute * 60 + second) * kSecondNs + fraction_ns;
  cursor.Maybe(" ");
  if (cursor.Maybe("Zz")) {
    time.has_zone = true;
  } else if (const std::optional<char> sign = cursor.Maybe("+-")) {
    const int zone_s = TakeZone(cursor, *sign);
    if (zone_s > kMaxZoneS || zone_s < -kMaxZoneS) return std::nullopt;
    time.stamp_ns -= zone_s * kSecondNs;
    time.has_zone = true;
  }
  if (!cursor.ok() || !cursor.at_end()) return std::nullopt;
  return time;
}

std::optional<int> ParseZone(std::string_view text) {
  if (text == "Z" || text == "z" || text == "UTC") return 0;
  TextCursor cursor(text);
  const char sign = cursor.Maybe("+-").value_or('+');
  int zone_s = 0;
  if (text.size() <= 2 && !cursor.TwoDigitsNext()) {
    zone_s = cursor.Digits(1) * 3600 * (sign == '-' ? -1 : 1);
  } else {
    zone_s = TakeZone(cursor, sign);
  }
  if (!cursor.ok() || !cursor.at_end()) return std::nullopt;
  if (zone_s > kMaxZoneS || zone_s < -kMaxZoneS) return std::nullopt;
  return zone_s;
}

std::optional<std::int64_t> TimeOfFileName(const std::string& name) {
  std::optional<std::int64_t> found;
  for (std::size_t begin = 0; begin < name.size(); ++begin) {
    if (!IsDigit(name[begin]) || (begin > 0 && IsDigit(name[begin - 1]))) continue;
    std::string digits;
    std::size_t at = begin, separators = 0;
    for (; at < name.size() && digits.size() < 14 && separators <= 1; ++at) {
      if (IsDigit(name[at])) {
        digits += name[at];
        separators = 0;
      } else if (std::string_view("_-. T").find(name[at]) != std::string_view::npos) {
        ++separators;
      } else {
        break;
      }
    }
    if (digits.size() < 14 || (at < name.size() && IsDigit(name[at]))) continue;
    const auto time = ParseTimeText(digits.substr(0, 8) + "T" + digits.substr(8));
    if (!time) continue;
    if (found) return std::nullopt;
    found = time->stamp_ns;
    begin = at;
  }
  return found;
}

}  // namespace livemap::recordings
