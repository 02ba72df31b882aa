#include "web/http/request_target.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace livemap::web {
namespace {

constexpr std::size_t kMaxTargetBytes = 4096;
constexpr std::size_t kMaxParameters = 32;

std::optional<unsigned char> HexByte(std::string_view two_digits) {
  unsigned value = 0;
  const char* end = two_digits.data() + two_digits.size();
  const auto result = std::from_chars(two_digits.data(), end, value, 16);
  if (two_digits.size() != 2 || result.ec != std::errc() || result.ptr != end) return std::nullopt;
  return static_cast<unsigned char>(value);
}

std::string PercentDecode(std::string_view text, bool plus_is_space) {
  std::string decoded;
  decoded.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      const auto byte = HexByte(text.substr(i + 1, 2));
      if (!byte) throw BadRequest("the address holds a malformed %-escape");
      c = static_cast<char>(*byte);
      i += 2;
    } else if (c == '+' && plus_is_space) {
      c = ' ';
    }
    if (c == '\0') throw BadRequest("the address holds a NUL byte");
    decoded += c;
  }
  return decoded;
}

}  // namespace

RequestTarget ParseTarget(std::string_view target) {
  if (target.size() > kMaxTargetBytes) {
    throw BadRequest("the address has " + std::to_string(target.size()) +
                     " bytes, accepted are at most " + std::to_string(kMaxTargetBytes));
  }
  if (target.empty() || target.front() != '/') throw BadRequest("the address must start with '/'");
  target = target.substr(0, target.find('#'));
  const std::size_t question = target.find('?');
  RequestTarget parsed;
  parsed.path = PercentDecode(target.substr(0, question), false);
  if (question == std::string_view::npos) return parsed;
  Split(target.substr(question + 1), '&', [&](std::string_view piece) {
    if (piece.empty()) return;
    if (parsed.parameters.size() == kMaxParameters) {
      throw BadRequest("the address has more than " + std::to_string(kMaxParameters) +
                       " parameters");
    }
    const std::size_t equals = piece.find('=');
    const std::string_view value =
        equals == std::string_view::npos ? std::string_view() : piece.substr(equals + 1);
    parsed.parameters.emplace_back(PercentDecode(piece.substr(0, equals), true),
                                   PercentDecode(value, true));
  });
  return parsed;
}

void RefuseQueryParameters(const RequestTarget& target) {
  if (target.parameters.empty()) return;
  RefuseUnknown(target.parameters.front().first, "this address accepts none");
}

void RefuseRepeated(const RequestTarget& target) {
  const auto& parameters = target.parameters;
  for (auto it = parameters.begin(); it != parameters.end(); ++it) {
    const bool repeated = std::any_of(parameters.begin(), it,
                                      [&](const auto& other) { return other.first == it->first; });
    if (repeated) throw BadRequest("the parameter " + Quoted(it->first) + " is given twice");
  }
}

void RefuseUnknown(const std::string& name, const std::string& accepted) {
  throw BadRequest("the parameter " + Quoted(name) + " is unknown, " + accepted);
}

std::string Quoted(std::string_view text) {
  constexpr std::size_t kShown = 60;
  std::string quoted = "'" + std::string(text.substr(0, kShown));
  if (text.size() > kShown) quoted += "...";
  return quoted + "'";
}

std::optional<double> FiniteNumber(std::string_view text) {
  double number = 0;
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, number, std::chars_format::fixed);
  if (text.empty() || result.ec != std::errc() || result.ptr != end || !std::isfinite(number)) {
    return std::nullopt;
  }
  return number;
}

std::optional<std::uint64_t> WholeNumber(std::string_view text) {
  std::uint64_t number = 0;
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, number);
  if (text.empty() || result.ec != std::errc() || result.ptr != end) return std::nullopt;
  return number;
}

geo::GeoBox ParseBox(const std::string& text) {
  std::array<double, 4> edges{};
  std::size_t count = 0;
  bool numbers = true;
  Split(text, ',', [&](std::string_view piece) {
    const auto number = FiniteNumber(piece);
    if (number && count < edges.size()) edges[count] = *number;
    numbers = numbers && number.has_value();
    ++count;
  });
  const auto [west, south, east, north] = edges;
  const bool accepted = numbers && count == 4 && std::abs(west) <= 180 && std::abs(east) <= 180 &&
                        -90 <= south && south <= north && north <= 90;
  if (!accepted) {
    throw BadRequest("bbox is " + Quoted(text) +
                     ", accepted is minLon,minLat,maxLon,maxLat in degrees with longitudes from "
                     "-180 to 180, latitudes from -90 to 90 and minLat <= maxLat");
  }
  return geo::GeoBox{{south, west}, {north, east}};
}

}  // namespace livemap::web
