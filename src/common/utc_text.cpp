#include "common/utc_text.h"

#include <array>
#include <cstddef>
#include <cstdio>
#include <ctime>

namespace livemap {

std::string Rfc3339(std::int64_t time_ns) {
  constexpr std::int64_t kNsPerSecond = 1'000'000'000;
  std::int64_t seconds = time_ns / kNsPerSecond;
  std::int64_t rest_ns = time_ns % kNsPerSecond;
  if (rest_ns < 0) {
    rest_ns += kNsPerSecond;
    --seconds;
  }
  const std::time_t time = seconds;
  std::tm utc{};
  gmtime_r(&time, &utc);
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", utc.tm_year + 1900,
                utc.tm_mon + 1, utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec,
                static_cast<int>(rest_ns / 1'000'000));
  return text.data();
}

std::string Rfc3339Seconds(std::int64_t time_ns) {
  constexpr std::size_t kToSeconds = 19;
  return Rfc3339(time_ns).substr(0, kToSeconds) + 'Z';
}

std::string UtcDay(std::int64_t time_ns) {
  constexpr std::size_t kToDay = 10;
  return Rfc3339(time_ns).substr(0, kToDay);
}

std::optional<std::int64_t> ParseRfc3339Seconds(std::string_view text) {
  constexpr std::string_view kForm = "0000-00-00T00:00:00Z";
  if (text.size() != kForm.size()) return std::nullopt;
  for (std::size_t i = 0; i < kForm.size(); ++i) {
    const bool is_digit = text[i] >= '0' && text[i] <= '9';
    if (kForm[i] == '0' ? !is_digit : text[i] != kForm[i]) return std::nullopt;
  }
  const auto number = [&](std::size_t from, std::size_t digits) {
    int value = 0;
    for (std::size_t i = from; i < from + digits; ++i) value = 10 * value + (text[i] - '0');
    return value;
  };
  std::tm utc{};
  utc.tm_year = number(0, 4) - 1900;
  utc.tm_mon = number(5, 2) - 1;
  utc.tm_mday = number(8, 2);
  utc.tm_hour = number(11, 2);
  utc.tm_min = number(14, 2);
  utc.tm_sec = number(17, 2);
  if (utc.tm_year < 70 || utc.tm_year > 205) return std::nullopt;
  const std::int64_t time_ns = std::int64_t{timegm(&utc)} * 1'000'000'000;
  // What is no date, timegm makes another one of.
  if (Rfc3339Seconds(time_ns) != text) return std::nullopt;
  return time_ns;
}

}  // namespace livemap
