#include "web/ogc/ogc_query.h"

#include <algorithm>
#include <array>
#include <vector>

#include "common/number_text.h"

namespace livemap::web {
namespace {

constexpr std::int64_t kNsOfSecond = 1'000'000'000;

/// Reads digits, signs and letters of fixed places, from the left.
class DigitReader {
 public:
  explicit DigitReader(std::string_view text) : rest_(text) {}

  /// A number of exactly so many digits within the range.
  int Number(std::size_t digits, int least, int most) {
    int number = 0;
    for (std::size_t i = 0; i < digits; ++i) {
      const char c = Take();
      is_good_ = is_good_ && c >= '0' && c <= '9';
      number = number * 10 + (c - '0');
    }
    is_good_ = is_good_ && number >= least && number <= most;
    return number;
  }
  /// One of these characters; it is returned in any case.
  char OneOf(std::string_view accepted) {
    const char c = Take();
    is_good_ = is_good_ && accepted.find(c) != std::string_view::npos;
    return c;
  }
  /// Digits after a point, where there is one, as ns; those after the ninth do not count.
  std::int64_t Fraction() {
    if (rest_.empty() || rest_.front() != '.') return 0;
    rest_.remove_prefix(1);
    std::int64_t ns = 0;
    std::int64_t unit = kNsOfSecond;
    std::size_t digits = 0;
    for (; !rest_.empty() && rest_.front() >= '0' && rest_.front() <= '9'; ++digits) {
      unit /= 10;
      ns += unit * (rest_.front() - '0');
      rest_.remove_prefix(1);
    }
    is_good_ = is_good_ && digits > 0;
    return ns;
  }
  bool IsDone() const { return is_good_ && rest_.empty(); }
  bool is_good() const { return is_good_; }

 private:
  char Take() {
    if (rest_.empty()) {
      is_good_ = false;
      return '0';
    }
    const char c = rest_.front();
    rest_.remove_prefix(1);
    return c;
  }

  std::string_view rest_;
  bool is_good_ = true;
};

/// Days since 1970 of a date of the Gregorian calendar.
/// Source: H. Hinnant, "chrono-Compatible Low-Level Date Algorithms", days_from_civil.
std::int64_t DaysOf(int year, int month, int day) {
  const int shifted = month <= 2 ? year - 1 : year;
  const int era = shifted / 400;
  const int year_of_era = shifted - era * 400;
  const int day_of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
  const int day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
  return std::int64_t{era} * 146'097 + day_of_era - 719'468;
}

int DaysOfMonth(int year, int month) {
  constexpr std::array<int, 12> kDays{31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  const bool is_leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
  return month == 2 && is_leap ? 29 : kDays[static_cast<std::size_t>(month - 1)];
}

/// A time of RFC 3339, none where the text is none. Its years are those that 64 bits of ns reach.
std::optional<std::int64_t> ParseTime(std::string_view text) {
  DigitReader reader(text);
  const int year = reader.Number(4, 1700, 2250);
  reader.OneOf("-");
  const int month = reader.Number(2, 1, 12);
  reader.OneOf("-");
  const int day = reader.Number(2, 1, 31);
  reader.OneOf("Tt");
  const int hour = reader.Number(2, 0, 23);
  reader.OneOf(":");
  const int minute = reader.Number(2, 0, 59);
  reader.OneOf(":");
  const int second = reader.Number(2, 0, 59);
  const std::int64_t fraction_ns = reader.Fraction();
  const char zone = reader.OneOf("Zz+-");
  std::int64_t offset_s = 0;
  if (zone == '+' || zone == '-') {
    const int hours = reader.Number(2, 0, 23);
    reader.OneOf(":");
    const int minutes = reader.Number(2, 0, 59);
    offset_s = std::int64_t{hours * 60 + minutes} * (zone == '+' ? 60 : -60);
  }
  if (!reader.IsDone() || day > DaysOfMonth(year, month)) return std::nullopt;
  const std::int64_t seconds =
      DaysOf(year, month, day) * 86'400 + ((hour * 60 + minute) * 60 + second) - offset_s;
  return seconds * kNsOfSecond + fraction_ns;
}

/// Six numbers are those of a box with heights.
geo::GeoBox ParseOgcBox(const std::string& text) {
  std::vector<std::string_view> numbers;
  Split(text, ',', [&](std::string_view piece) {
    if (numbers.size() < 7) numbers.push_back(piece);
  });
  if (numbers.size() != 6) return ParseBox(text);
  const bool has_heights = FiniteNumber(numbers[2]) && FiniteNumber(numbers[5]);
  if (!has_heights) {
    throw BadRequest("bbox is " + Quoted(text) +
                     ", accepted are four numbers, or six with heights");
  }
  const auto flat = [&](std::size_t i) { return std::string(numbers[i]); };
  return ParseBox(flat(0) + ',' + flat(1) + ',' + flat(3) + ',' + flat(4));
}

std::size_t ParseOgcLimit(const std::string& text) {
  const auto number = WholeNumber(text);
  if (!number || *number < 1) {
    throw BadRequest("limit is " + Quoted(text) + ", accepted is a whole number from 1, of which " +
                     std::to_string(kMaxOgcItems) + " count at most");
  }
  return static_cast<std::size_t>(std::min<std::uint64_t>(*number, kMaxOgcItems));
}

std::uint64_t ParseCursor(const std::string& text) {
  const auto number = WholeNumber(text);
  if (number && *number <= INT64_MAX) return *number;
  throw BadRequest("cursor is " + Quoted(text) + ", accepted is the one of a link to a next page");
}

void AppendPercentEncoded(std::string& address, std::string_view text) {
  for (const char c : text) {
    const bool is_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    const bool is_plain = is_letter || (c >= '0' && c <= '9') ||
                          std::string_view("-._~,:/").find(c) != std::string_view::npos;
    if (is_plain) {
      address += c;
    } else {
      address += '%';
      AppendHex(address, static_cast<std::uint8_t>(c));
    }
  }
}

}  // namespace

TimeSpan ParseDatetime(const std::string& text) {
  const BadRequest mistake("datetime is " + Quoted(text) +
                           ", accepted is a time such as 2026-01-31T12:00:00Z, or two with '/' "
                           "between, the first not after the second, of which one may be '..'; a "
                           "'+' in an address is %2B");
  const std::size_t slash = text.find('/');
  if (slash == std::string::npos) {
    const auto time = ParseTime(text);
    if (!time) throw mistake;
    return {*time, *time};
  }
  TimeSpan span;
  const std::string_view all(text);
  const std::string_view begin = all.substr(0, slash);
  const std::string_view end = all.substr(slash + 1);
  const auto is_open = [](std::string_view side) { return side.empty() || side == ".."; };
  const auto begin_ns = ParseTime(begin);
  const auto end_ns = ParseTime(end);
  const bool is_accepted = (begin_ns || is_open(begin)) && (end_ns || is_open(end)) &&
                           (begin_ns || end_ns) && !(begin_ns && end_ns && *begin_ns > *end_ns);
  if (!is_accepted) throw mistake;
  if (begin_ns) span.begin_ns = *begin_ns;
  if (end_ns) span.end_ns = *end_ns;
  return span;
}

OgcQuery ParseOgcQuery(const RequestTarget& target) {
  RefuseRepeated(target);
  OgcQuery query;
  for (const auto& [name, value] : target.parameters) {
    if (name == "bbox") {
      query.box = ParseOgcBox(value);
    } else if (name == "datetime") {
      query.time = ParseDatetime(value);
    } else if (name == "limit") {
      query.limit = ParseOgcLimit(value);
    } else if (name == "cursor") {
      query.cursor = ParseCursor(value);
    } else {
      RefuseUnknown(name, "accepted are bbox, datetime, limit and cursor");
    }
  }
  return query;
}

std::string NextPage(const RequestTarget& target, std::uint64_t cursor) {
  std::string address;
  AppendPercentEncoded(address, target.path);
  address += '?';
  for (const auto& [name, value] : target.parameters) {
    if (name == "cursor") continue;
    AppendPercentEncoded(address, name);
    address += '=';
    AppendPercentEncoded(address, value);
    address += '&';
  }
  return address + "cursor=" + std::to_string(cursor);
}

}  // namespace livemap::web
