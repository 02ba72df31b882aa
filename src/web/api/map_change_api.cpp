#include "web/api/map_change_api.h"

#include "web/api/collections.h"
#include "web/json/map_change_json.h"

namespace livemap::web {
namespace {

HttpResponse UnknownMapChange() {
  return MakeErrorAnswer(404, "the zone knows no map change with this id");
}

Uuid ParseMapChangeId(const std::string& id) {
  const auto uuid = Uuid::Parse(id);
  if (!uuid) throw BadRequest("the map change's id is no UUID");
  return *uuid;
}

/// What a client should do that shows the states that the query asks for.
zone::HazardAction ActionFor(const zone::MapChangeFeature& change, const MapChangeQuery& query) {
  if (!query.Selects(change.state)) return zone::HazardAction::kRemoved;
  return zone::IsOpen(change.state) ? ReplayAction(change) : zone::HazardAction::kUpdated;
}

}  // namespace

HttpResponse MapChangeApi::Answer(const RequestTarget& target) const {
  const std::string rest = target.path.substr(std::string_view(kMapChangeAddress).size());
  if (rest.empty()) return List(ParseMapChangeQuery(target));
  if (rest.front() != '/') return MakeErrorAnswer(404, "there is nothing at this address");
  if (const auto id = IdOfHistory(rest)) return Events(*id, ParseEventsQuery(target));
  RefuseQueryParameters(target);
  return One(rest.substr(1));
}

HttpResponse MapChangeApi::List(const MapChangeQuery& query) const {
  zone::Walk<zone::MapChangeState> walk;
  walk.box = query.box;
  walk.after = query.since.value_or(0);
  walk.until = zone_.Sequence();  // Before the list.
  // Since a sequence all that changed is looked at: what left the selection is told too.
  if (!query.since) {
    walk.states = query.states.empty() ? zone::OpenStates() : query.states;
  } else if (*query.since == 0) {
    walk.states = zone::OpenStates();
  }
  const auto read = [this](const auto& where, std::size_t limit) {
    return zone_.ReadMapChanges(where, limit);
  };
  const auto to_feature = [query](const zone::MapChangeFeature& change) {
    Json feature = MapChangeGeoJson(change);
    if (query.since) feature["properties"]["action"] = ActionName(ActionFor(change, query));
    return feature;
  };
  return ListAnswer(std::move(walk), query.limit, zone_.LogId(), read, to_feature);
}

HttpResponse MapChangeApi::One(const std::string& id) const {
  const auto feature = zone_.FindMapChange(ParseMapChangeId(id));
  return feature ? JsonAnswer(MapChangeGeoJson(*feature), "application/geo+json")
                 : UnknownMapChange();
}

HttpResponse MapChangeApi::Events(const std::string& id, std::size_t limit) const {
  const Uuid uuid = ParseMapChangeId(id);
  if (!zone_.FindMapChange(uuid)) return UnknownMapChange();
  return EventsAnswer(uuid, zone_.MapChangeEvents(uuid, limit), MapChangeEventJson);
}

}  // namespace livemap::web
