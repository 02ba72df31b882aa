#include "web/api/hazard_api.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <string_view>
#include <utility>

#include "streets/street_place.h"
#include "web/access/access.h"
#include "web/api/collections.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

constexpr std::array<const char*, 12> kPointColumns{
    "id",         "latitude",  "longitude", "class",     "state",    "presence",
    "confidence", "sightings", "vehicles",  "updated_s", "sequence", "first_seen_s"};

/// Further columns where the zone knows its streets.
constexpr std::array<const char*, 3> kStreetColumns{"street", "near", "direction"};

/// What a client should do that shows the states that the query asks for.
zone::HazardAction ActionFor(const zone::Hazard& hazard, const HazardQuery& query) {
  return query.Selects(hazard.state) ? ReplayAction(hazard) : zone::HazardAction::kRemoved;
}

void AppendNumber(std::string& text, double number, int digits) {
  std::array<char, 64> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number,
                                 std::chars_format::fixed, digits);
  std::string_view written(buffer.data(), static_cast<std::size_t>(end.ptr - buffer.data()));
  while (written.back() == '0') written.remove_suffix(1);
  if (written.back() == '.') written.remove_suffix(1);
  text += written;
}

void AppendSeconds(std::string& text, std::int64_t time_ns) {
  const std::int64_t time_ms = time_ns / 1'000'000;
  AppendNumber(text, static_cast<double>(time_ms) / 1000.0, 3);
}

/// One line of the points, in the order of kPointColumns. Written by hand: a list has a hundred
/// thousand of them.
void AppendPoint(std::string& text, const zone::Hazard& hazard) {
  text += "[\"";
  text += hazard.uuid.ToString();
  text += "\",";
  AppendNumber(text, hazard.position.latitude_deg, 7);
  text += ',';
  AppendNumber(text, hazard.position.longitude_deg, 7);
  text += ',';
  text += ToText(hazard.class_name);
  text += ",\"";
  text += zone::HazardStateName(hazard.state);
  text += "\",";
  AppendNumber(text, static_cast<double>(hazard.presence), 4);
  text += ',';
  AppendNumber(text, static_cast<double>(hazard.confidence), 4);
  text += ',' + std::to_string(hazard.sightings) + ',' + std::to_string(hazard.vehicles) + ',';
  AppendSeconds(text, hazard.updated_ns);
  text += ',' + std::to_string(hazard.sequence) + ',';
  AppendSeconds(text, hazard.first_seen_ns);
}

/// The same of kStreetColumns.
void AppendWords(std::string& text, const streets::StreetWords& words) {
  for (const std::string* word : {&words.street, &words.near, &words.direction}) {
    text += ',' + (word->empty() ? "null" : ToText(*word));
  }
}

HttpResponse UnknownHazard() {
  return MakeErrorAnswer(404, "the zone knows no hazard with this id");
}

/// Leaves the states of which drivers are told, all of them where none are named; false where none
/// are left.
bool KeepTold(zone::HazardStates& states) {
  const zone::HazardStates wanted = states.empty() ? zone::StatesOnMap() : states;
  states.clear();
  for (const zone::HazardState state : wanted) {
    if (zone::IsTold(state)) states.insert(state);
  }
  return !states.empty();
}

/// Those of which drivers never heard.
void RemoveUntold(std::vector<zone::Hazard>& hazards) {
  hazards.erase(std::remove_if(hazards.begin(), hazards.end(),
                               [](const auto& hazard) { return hazard.announced_sequence == 0; }),
                hazards.end());
}

Uuid ParseHazardId(const std::string& id) {
  const auto uuid = Uuid::Parse(id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  return *uuid;
}

}  // namespace

HttpResponse HazardApi::Answer(const RequestTarget& target, bool all) const {
  const std::string rest = target.path.substr(std::string_view(kHazardAddress).size());
  if (rest.empty()) return List(ParseHazardQuery(target), all);
  if (rest.front() != '/') return MakeErrorAnswer(404, "there is nothing at this address");
  if (rest == "/points") return Points(ParsePointsQuery(target), all);
  if (const auto id = IdOfHistory(rest)) {
    return all ? Events(*id, ParseEventsQuery(target)) : LogInFirst();
  }
  RefuseQueryParameters(target);
  return One(rest.substr(1), all);
}

HttpResponse HazardApi::List(HazardQuery query, bool all) const {
  if (!all && !KeepTold(query.states)) return LogInFirst();
  zone::Walk<zone::HazardState> walk;
  walk.box = query.box;
  walk.after = query.since.value_or(0);
  walk.until = zone_.Sequence();  // Before the list.
  // Since a sequence all that changed is looked at: what left the selection is told too.
  if (!query.since) {
    walk.states = query.states.empty() ? zone::StatesOnMap() : query.states;
  } else if (*query.since == 0) {
    walk.states = zone::StatesOnMap();
  }
  const auto read = [this, all](const auto& where, std::size_t limit) {
    auto page = zone_.ReadHazards(where, limit);
    if (!all) RemoveUntold(page.items);
    return page;
  };
  const auto to_feature = [this, query](const zone::Hazard& hazard) {
    Json feature = HazardFeature(hazard, catalogue_, zone_.WordsOf(hazard));
    if (query.since) feature["properties"]["action"] = ActionName(ActionFor(hazard, query));
    return feature;
  };
  return ListAnswer(std::move(walk), query.limit, zone_.LogId(), read, to_feature);
}

HttpResponse HazardApi::Points(PointsQuery query, bool all) const {
  if (!all && !KeepTold(query.states)) return LogInFirst();
  zone::Walk<zone::HazardState> walk;
  walk.states = query.states.empty() ? zone::StatesOnMap() : query.states;
  walk.until = zone_.Sequence();  // Before the points.
  std::size_t count = 0;
  const auto counts = zone_.HazardCounts();
  for (const zone::HazardState state : walk.states) {
    count += counts[static_cast<std::size_t>(state)];
  }
  Json header;
  header["sequence"] = walk.until;
  header["count"] = count;
  Json& columns = header["columns"] = kPointColumns;
  if (zone_.streets() != nullptr) {
    for (const char* name : kStreetColumns) columns.push_back(name);
  }
  auto pieces = [this, walk = std::move(walk),
                 head = ToText(header) + "\n"](std::string& piece) mutable {
    piece += head;
    head.clear();
    const auto page = zone_.ReadHazards(walk, kItemsPerRead);
    for (const zone::Hazard& hazard : page.items) {
      AppendPoint(piece, hazard);
      if (zone_.streets() != nullptr) AppendWords(piece, zone_.WordsOf(hazard));
      piece += "]\n";
    }
    walk.after = page.sequence;
    return !page.is_last;
  };
  return PiecesAnswer(std::move(pieces), "application/x-ndjson");
}

HttpResponse HazardApi::One(const std::string& id, bool all) const {
  const auto hazard = zone_.Find(ParseHazardId(id));
  if (!hazard || (!all && hazard->announced_sequence == 0)) return UnknownHazard();
  Json feature = HazardFeature(*hazard, catalogue_, zone_.WordsOf(*hazard));
  feature["properties"]["active"] = zone::IsOnMap(hazard->state);
  return JsonAnswer(feature, "application/geo+json");
}

HttpResponse HazardApi::Events(const std::string& id, std::size_t limit) const {
  const Uuid uuid = ParseHazardId(id);
  if (!zone_.Find(uuid)) return UnknownHazard();
  return EventsAnswer(uuid, zone_.Events(uuid, limit), EventJson);
}

}  // namespace livemap::web
