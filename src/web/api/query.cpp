#include "web/api/query.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <set>

namespace livemap::web {
namespace {

constexpr std::size_t kMaxTargetBytes = 4096;
constexpr std::size_t kMaxParameters = 32;
constexpr std::array<zone::HazardState, zone::kHazardStates> kAllHazardStates{
    zone::HazardState::kCandidate, zone::HazardState::kActive, zone::HazardState::kVerifying,
    zone::HazardState::kGone, zone::HazardState::kRejected};

/// A client's text as part of an error sentence: short, so that the answer stays small.
std::string Quoted(std::string_view text) {
  constexpr std::size_t kShown = 60;
  std::string quoted = "'" + std::string(text.substr(0, kShown));
  if (text.size() > kShown) quoted += "...";
  return quoted + "'";
}

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

/// Calls `take` with each piece of `text` between separators; an empty text has one empty piece.
template <typename Take>
void Split(std::string_view text, char separator, Take take) {
  for (;;) {
    const std::size_t end = text.find(separator);
    take(text.substr(0, end));
    if (end == std::string_view::npos) return;
    text.remove_prefix(end + 1);
  }
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

/// The sequence is a 63-bit number in the store.
std::uint64_t ParseSequence(const std::string& text) {
  const auto number = WholeNumber(text);
  if (!number || *number > INT64_MAX) {
    throw BadRequest("since is " + Quoted(text) +
                     ", accepted is a sequence number, a whole number from 0");
  }
  return *number;
}

std::size_t ParseLimit(const std::string& text, std::size_t most) {
  const auto number = WholeNumber(text);
  if (!number || *number < 1 || *number > most) {
    throw BadRequest("limit is " + Quoted(text) + ", accepted is a whole number from 1 to " +
                     std::to_string(most));
  }
  return *number;
}

/// "a, b and c".
const char* NameOfState(zone::HazardState state) { return zone::HazardStateName(state); }
const char* NameOfState(zone::MapChangeState state) { return zone::MapChangeStateName(state); }

template <typename State, std::size_t kCount>
std::string StateNames(const std::array<State, kCount>& all) {
  std::string names = NameOfState(all.front());
  for (std::size_t i = 1; i < kCount; ++i) {
    names += (i + 1 < kCount ? ", " : " and ") + std::string(NameOfState(all[i]));
  }
  return names;
}

template <typename State, std::size_t kCount>
std::set<State> ParseStates(const std::string& text, const std::array<State, kCount>& all) {
  std::set<State> states;
  Split(text, ',', [&](std::string_view piece) {
    for (const State state : all) {
      if (piece == NameOfState(state) && states.insert(state).second) return;
    }
    throw BadRequest("state is " + Quoted(text) + ", accepted are " + StateNames(all) +
                     ", each once, with commas between");
  });
  return states;
}

void RefuseRepeated(const RequestTarget& target) {
  const auto& parameters = target.parameters;
  for (auto it = parameters.begin(); it != parameters.end(); ++it) {
    const bool repeated = std::any_of(parameters.begin(), it,
                                      [&](const auto& other) { return other.first == it->first; });
    if (repeated) throw BadRequest("the parameter " + Quoted(it->first) + " is given twice");
  }
}

[[noreturn]] void RefuseUnknown(const std::string& name, const std::string& accepted) {
  throw BadRequest("the parameter " + Quoted(name) + " is unknown, " + accepted);
}

template <typename Query, typename States>
Query ParseListQuery(const RequestTarget& target, const States& all_states) {
  RefuseRepeated(target);
  Query query;
  for (const auto& [name, value] : target.parameters) {
    if (name == "bbox") {
      query.box = ParseBox(value);
    } else if (name == "since") {
      query.since = ParseSequence(value);
    } else if (name == "limit") {
      query.limit = ParseLimit(value, kMaxHazardsPerAnswer);
    } else if (name == "state") {
      query.states = ParseStates(value, all_states);
    } else {
      RefuseUnknown(name, "accepted are bbox, since, limit and state");
    }
  }
  return query;
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

HazardQuery ParseHazardQuery(const RequestTarget& target) {
  return ParseListQuery<HazardQuery>(target, kAllHazardStates);
}

PointsQuery ParsePointsQuery(const RequestTarget& target) {
  RefuseRepeated(target);
  PointsQuery query;
  for (const auto& [name, value] : target.parameters) {
    if (name != "state") RefuseUnknown(name, "accepted is state");
    query.states = ParseStates(value, kAllHazardStates);
  }
  return query;
}

MapChangeQuery ParseMapChangeQuery(const RequestTarget& target) {
  return ParseListQuery<MapChangeQuery>(
      target, std::array<zone::MapChangeState, zone::kMapChangeStates>{
                  zone::MapChangeState::kProposed, zone::MapChangeState::kConfirmed,
                  zone::MapChangeState::kUndone, zone::MapChangeState::kDismissed});
}

StreetQuery ParseStreetQuery(const RequestTarget& target) {
  constexpr std::uint64_t kMaxZoom = 22;
  constexpr double kMaxPx = 2048;
  RefuseRepeated(target);
  StreetQuery query;
  bool has_box = false;
  bool has_zoom = false;
  for (const auto& [name, value] : target.parameters) {
    if (name == "bbox") {
      query.box = ParseBox(value);
      has_box = true;
    } else if (name == "zoom") {
      const auto zoom = WholeNumber(value);
      if (!zoom || *zoom > kMaxZoom) {
        throw BadRequest("zoom is " + Quoted(value) + ", accepted is a whole number from 0 to 22");
      }
      query.zoom = static_cast<int>(*zoom);
      has_zoom = true;
    } else {
      RefuseUnknown(name, "accepted are bbox and zoom");
    }
  }
  if (!has_box || !has_zoom) throw BadRequest("bbox and zoom must both be given");
  const auto& [south_west, north_east] = query.box;
  const double px_deg = 360 / (256 * std::pow(2, query.zoom));
  const double width_deg = north_east.longitude_deg - south_west.longitude_deg;
  const double height_deg = north_east.latitude_deg - south_west.latitude_deg;
  if (width_deg < 0 || std::max(width_deg, height_deg) > kMaxPx * px_deg) {
    throw BadRequest("bbox is too wide for the zoom, accepted are boxes of at most " +
                     std::to_string(kMaxPx * px_deg) + " degrees that do not cross 180 degrees");
  }
  return query;
}

std::size_t ParseEventsQuery(const RequestTarget& target) {
  RefuseRepeated(target);
  std::size_t limit = 100;
  for (const auto& [name, value] : target.parameters) {
    if (name != "limit") RefuseUnknown(name, "accepted is limit");
    limit = ParseLimit(value, kMaxEventsPerAnswer);
  }
  return limit;
}

DecisionsQuery ParseDecisionsQuery(const RequestTarget& target) {
  RefuseRepeated(target);
  DecisionsQuery query;
  for (const auto& [name, value] : target.parameters) {
    if (name == "before") {
      query.before = ParseSequence(value);
    } else if (name == "limit") {
      query.limit = ParseLimit(value, kMaxEventsPerAnswer);
    } else {
      RefuseUnknown(name, "accepted are before and limit");
    }
  }
  return query;
}

std::optional<std::uint64_t> ParseStreamQuery(const RequestTarget& target) {
  RefuseRepeated(target);
  std::optional<std::uint64_t> since;
  for (const auto& [name, value] : target.parameters) {
    if (name != "since") RefuseUnknown(name, "accepted is since");
    since = ParseSequence(value);
  }
  return since;
}

void RefuseQueryParameters(const RequestTarget& target) {
  if (target.parameters.empty()) return;
  RefuseUnknown(target.parameters.front().first, "this address accepts none");
}

}  // namespace livemap::web
