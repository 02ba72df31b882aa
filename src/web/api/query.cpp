#include "web/api/query.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace livemap::web {
namespace {

constexpr std::array<zone::HazardState, zone::kHazardStates> kAllHazardStates{
    zone::HazardState::kCandidate, zone::HazardState::kActive, zone::HazardState::kVerifying,
    zone::HazardState::kGone, zone::HazardState::kRejected};

constexpr std::array<orders::OrderState, orders::kOrderStates> kAllOrderStates{
    orders::OrderState::kWaiting, orders::OrderState::kSent, orders::OrderState::kClosed,
    orders::OrderState::kFailed, orders::OrderState::kCancelled};

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
const char* NameOfState(orders::OrderState state) { return orders::OrderStateName(state); }

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

Uuid ParseHazardParameter(const std::string& value) {
  if (const auto uuid = Uuid::Parse(value)) return *uuid;
  throw BadRequest("hazard is " + Quoted(value) + ", accepted is the UUID of a hazard");
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
    } else if (name == "hazard") {
      query.hazard = ParseHazardParameter(value);
    } else {
      RefuseUnknown(name, "accepted are before, limit and hazard");
    }
  }
  if (query.hazard && query.before != UINT64_MAX) {
    throw BadRequest("before is not accepted beside hazard");
  }
  return query;
}

orders::OrderFilter ParseOrdersQuery(const RequestTarget& target) {
  RefuseRepeated(target);
  orders::OrderFilter query;
  for (const auto& [name, value] : target.parameters) {
    if (name == "before") {
      query.before = ParseSequence(value);
    } else if (name == "limit") {
      query.limit = ParseLimit(value, kMaxEventsPerAnswer);
    } else if (name == "state") {
      const auto states = ParseStates(value, kAllOrderStates);
      if (states.size() > 1) throw BadRequest("state names several states, accepted is one");
      query.state = *states.begin();
    } else if (name == "recipient") {
      if (value.empty()) throw BadRequest("recipient is empty, accepted is a recipient's name");
      query.recipient = value;
    } else if (name == "hazard") {
      query.hazard = ParseHazardParameter(value);
    } else {
      RefuseUnknown(name, "accepted are before, limit, state, recipient and hazard");
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

}  // namespace livemap::web
