#include "datasets/text_parsing.h"

#include <charconv>
#include <cmath>

namespace livemap::datasets {
namespace {

constexpr char kBlanks[] = " \t\r";

}  // namespace

std::optional<double> ParseFinite(const std::string& text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string::npos) return std::nullopt;
  const std::size_t end = text.find_last_not_of(kBlanks) + 1;
  const char* begin = text.data() + first;
  if (*begin == '+') ++begin;
  double value = 0;
  const auto [stopped_at, error] = std::from_chars(begin, text.data() + end, value);
  if (error != std::errc() || stopped_at != text.data() + end || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::vector<std::string> Split(const std::string& line, char separator) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  for (std::size_t end = line.find(separator); end != std::string::npos;
       end = line.find(separator, begin)) {
    parts.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  parts.push_back(line.substr(begin));
  return parts;
}

std::vector<std::string> SplitBlanks(const std::string& line) {
  std::vector<std::string> parts;
  std::size_t begin = line.find_first_not_of(kBlanks);
  while (begin != std::string::npos) {
    const std::size_t end = line.find_first_of(kBlanks, begin);
    parts.push_back(line.substr(begin, end == std::string::npos ? end : end - begin));
    begin = end == std::string::npos ? end : line.find_first_not_of(kBlanks, end);
  }
  return parts;
}

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines = Split(text, '\n');
  for (std::string& line : lines) line.resize(line.find_last_not_of(kBlanks) + 1);
  while (!lines.empty() && lines.back().empty()) lines.pop_back();
  return lines;
}

std::string SeparatorHint(const std::string& line) {
  for (const char separator : {',', ';'}) {
    if (line.find(separator) == std::string::npos) continue;
    return std::string(": its columns are separated by '") + separator + "', accepted are blanks";
  }
  return "";
}

std::string StampHint(const std::string& stamp) {
  const std::optional<double> value = ParseFinite(stamp);
  if (!value) return "";
  if (*value < 0) return ": its stamp is negative";
  // Since 1970 there are 1e9 s and more, up to 2106 fewer than 5e9.
  if (*value < 1e11) return "";
  const char* const unit = *value < 1e14   ? "milliseconds"
                           : *value < 1e17 ? "microseconds"
                                           : "nanoseconds";
  return std::string(": its stamp looks like ") + unit + ", accepted are seconds";
}

}  // namespace livemap::datasets
