#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace livemap {

/// RFC 3339 in UTC with milliseconds, "2026-01-31T12:00:00.250Z", of nanoseconds since 1970. What
/// is below a millisecond is cut off. Stamps before 1970 are written, too.
std::string Rfc3339(std::int64_t time_ns);

/// The same in whole seconds: "2026-01-31T12:00:00Z".
std::string Rfc3339Seconds(std::int64_t time_ns);

/// The day of Rfc3339: "2026-01-31".
std::string UtcDay(std::int64_t time_ns);

/// The stamp of "2026-01-31T12:00:00Z", as Rfc3339Seconds writes it. None for every other text, for
/// a date or time that is none, and for years before 1970 or after 2105.
std::optional<std::int64_t> ParseRfc3339Seconds(std::string_view text);

}  // namespace livemap
