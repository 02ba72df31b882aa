#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace livemap::recordings {

/// A date and time as a file states it.
struct TimeText {
  std::int64_t stamp_ns = 0;  ///< UTC where `has_zone`, else the time of an unnamed zone.
  bool has_zone = false;
};

/// "2026-01-31T12:34:56.789Z": ISO 8601 with a date and a time of day to the second, and what
/// devices write instead: blanks or underscores for the T; colons, slashes, points or nothing in
/// the date; a comma in the fraction; "Z", "+02:00", "+0200" or no zone. A leap second counts as
/// the second after it. None for everything else, for dates that are none, and for years before
/// 1980 or after 2105.
std::optional<TimeText> ParseTimeText(std::string_view text);

/// Nanoseconds since 1970 of midnight at the begin of a day; none as in ParseTimeText.
std::optional<std::int64_t> StampOfDay(int year, int month, int day);

/// "+02:00", "-0330", "Z" or "2": seconds that the zone is ahead of UTC; within 15 hours.
std::optional<int> ParseZone(std::string_view text);

/// The time of 14 digits in a file's name, such as 2026_0131_123456_F.MP4: local time of the
/// recorder. `name` is without folder. None where there are none, or several that are times.
std::optional<std::int64_t> TimeOfFileName(const std::string& name);

}  // namespace livemap::recordings
