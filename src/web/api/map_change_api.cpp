#include "web/api/map_change_api.h"

#include <algorithm>

#include "web/json/map_change_json.h"

namespace livemap::web {
namespace {

constexpr std::string_view kHistoryEnding = "/events";

HttpResponse UnknownMapChange() {
  return MakeErrorAnswer(404, "the zone knows no map change with this id");
}

Uuid ParseMapChangeId(const std::string& id) {
  const auto uuid = Uuid::Parse(id);
  if (!uuid) throw BadRequest("the map change's id is no UUID");
  return *uuid;
}

}  // namespace

HttpResponse MapChangeApi::Answer(const RequestTarget& target) const {
  const std::string rest = target.path.substr(std::string_view(kMapChangeAddress).size());
  if (rest.empty()) return List(ParseMapChangeQuery(target));
  if (rest.front() != '/') return MakeErrorAnswer(404, "there is nothing at this address");
  const std::string id = rest.substr(1);
  const bool history =
      id.size() >= kHistoryEnding.size() &&
      id.compare(id.size() - kHistoryEnding.size(), std::string::npos, kHistoryEnding.data()) == 0;
  if (history) {
    return Events(id.substr(0, id.size() - kHistoryEnding.size()), ParseEventsQuery(target));
  }
  RefuseParameters(target);
  return One(id);
}

HttpResponse MapChangeApi::List(const MapChangeQuery& query) const {
  // Read before the list: an event that comes between the two is in the list and told again.
  std::uint64_t sequence = zone_.Sequence();
  // Since a sequence all that changed is looked at: what left the selection is told too.
  const auto changes = zone_.QueryMapChanges(query.box, query.since.value_or(0), query.limit,
                                             query.since ? zone::MapChangeStates() : query.states);
  const bool truncated = changes.size() == query.limit;
  Json features = Json::array();
  std::uint64_t newest = 0;
  for (const zone::MapChangeFeature& change : changes) {
    newest = std::max(newest, change.sequence);
    Json feature = MapChangeGeoJson(change);
    if (query.since) {
      const bool selected = query.Selects(change.state);
      const zone::HazardAction action = selected && zone::IsOpen(change.state)
                                            ? ReplayAction(change)
                                        : selected ? zone::HazardAction::kUpdated
                                                   : zone::HazardAction::kRemoved;
      feature["properties"]["action"] = ActionName(action);
    }
    features.push_back(std::move(feature));
  }
  sequence = truncated ? newest : std::max(sequence, newest);
  Json collection;
  collection["type"] = "FeatureCollection";
  collection["sequence"] = sequence;
  collection["truncated"] = truncated;
  collection["features"] = std::move(features);
  return JsonAnswer(collection, "application/geo+json");
}

HttpResponse MapChangeApi::One(const std::string& id) const {
  const auto feature = zone_.FindMapChange(ParseMapChangeId(id));
  return feature ? JsonAnswer(MapChangeGeoJson(*feature), "application/geo+json")
                 : UnknownMapChange();
}

HttpResponse MapChangeApi::Events(const std::string& id, std::size_t limit) const {
  const Uuid uuid = ParseMapChangeId(id);
  if (!zone_.FindMapChange(uuid)) return UnknownMapChange();
  Json events = Json::array();
  for (const zone::StoredMapChangeEvent& event : zone_.MapChangeEvents(uuid, limit)) {
    events.push_back(MapChangeEventJson(event));
  }
  Json answer;
  answer["id"] = uuid.ToString();
  answer["events"] = std::move(events);
  return JsonAnswer(answer);
}

}  // namespace livemap::web
