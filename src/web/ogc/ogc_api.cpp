#include "web/ogc/ogc_api.h"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "common/utc_text.h"
#include "web/access/access.h"
#include "web/http/server_address.h"
#include "web/json/json.h"
#include "web/json/map_change_json.h"
#include "web/ogc/street_counts.h"

namespace livemap::web {
namespace {

constexpr const char* kHazards = "hazards";
constexpr const char* kMapChanges = "map_changes";
constexpr const char* kStreets = "streets";
constexpr const char* kFeatureType = "application/geo+json";
constexpr std::size_t kFeaturesPerRead = 128;
constexpr std::string_view kCollectionPrefix = "/collections/";
constexpr std::string_view kItemsEnding = "/items";

HttpResponse OgcRefusal(int status, const char* code, const std::string& description) {
  HttpResponse answer = JsonAnswer({{"code", code}, {"description", description}});
  answer.status = status;
  return answer;
}

HttpResponse NotThere(const std::string& sentence) { return OgcRefusal(404, "NotFound", sentence); }

/// Writes a FeatureCollection whose members come one by one.
class FeatureWriter {
 public:
  /// The link to the next page is made of `target` and the last feature's cursor.
  FeatureWriter(std::string server, RequestTarget target, std::int64_t now_ns)
      : server_(std::move(server)), target_(std::move(target)), now_ns_(now_ns) {}

  void Begin(std::string& text) {
    if (!is_begun_) text += R"({"type":"FeatureCollection","features":[)";
    is_begun_ = true;
  }
  void Add(const Json& feature, std::uint64_t cursor, std::string& text) {
    if (count_ > 0) text += ',';
    ++count_;
    cursor_ = cursor;
    text += ToText(feature);
  }
  /// `self` is the page's own address.
  void End(const std::string& self, bool has_more, std::string& text) const {
    Json links = Json::array({OgcLink(self, "self", kFeatureType, "This page")});
    if (has_more) {
      links.push_back(
          OgcLink(server_ + NextPage(target_, cursor_), "next", kFeatureType, "Next page"));
    }
    text += R"(],"numberReturned":)" + std::to_string(count_) + R"(,"timeStamp":")" +
            Rfc3339(now_ns_) + R"(","links":)" + ToText(links) + '}';
  }
  std::size_t count() const { return count_; }

 private:
  std::string server_;
  RequestTarget target_;
  std::int64_t now_ns_;
  std::size_t count_ = 0;
  std::uint64_t cursor_ = 0;
  bool is_begun_ = false;
};

/// Items of a walk that `keep` takes, as features, until there are `limit` and one more was seen.
template <typename State, typename Read, typename Keep, typename ToFeature>
HttpResponse WalkAnswer(FeatureWriter writer, const std::string& self, zone::Walk<State> walk,
                        std::size_t limit, Read read, Keep keep, ToFeature to_feature) {
  auto pieces = [writer = std::move(writer), self, walk = std::move(walk), limit,
                 read = std::move(read), keep = std::move(keep),
                 to_feature = std::move(to_feature)](std::string& piece) mutable {
    writer.Begin(piece);
    const auto page = read(walk, std::min(limit - writer.count() + 1, kFeaturesPerRead));
    for (const auto& item : page.items) {
      if (!keep(item)) continue;
      if (writer.count() == limit) {
        writer.End(self, true, piece);
        return false;
      }
      writer.Add(to_feature(item), item.sequence, piece);
    }
    walk.after = page.sequence;
    if (page.is_last) writer.End(self, false, piece);
    return !page.is_last;
  };
  return PiecesAnswer(std::move(pieces), kFeatureType);
}

/// Whether the query's interval and the time for which an item was seen have a moment in common.
template <typename Item>
bool WasSeenIn(const OgcQuery& query, const Item& item) {
  return !query.time || query.time->Meets(item.first_seen_ns, item.last_seen_ns);
}

}  // namespace

OgcApi::OgcApi(FeedSource source) : source_(std::move(source)), tags_(SystemNs()) {}

HttpResponse OgcApi::Answer(const RequestTarget& target, const HttpRequest& question,
                            const Visibility& sees) const {
  if (!sees.told) return LogInFirst();
  const std::string server = ServerAddress(source_.options, question);
  const Asked asked{target,          sees, server, server + kOgcAddress, server + question.target,
                    source_.now_ns()};
  const std::string tag =
      tags_.TagOf(source_.zone.Sequence(), asked.now_ns, server, question, sees);
  try {
    HttpResponse answer = Route(asked);
    if (answer.status != 200) return answer;
    if (auto unchanged = ChangeTags::Unchanged(tag, question)) return *std::move(unchanged);
    return ChangeTags::Tagged(std::move(answer), tag);
  } catch (const BadRequest& mistake) {
    return OgcRefusal(400, "InvalidParameterValue", mistake.what());
  }
}

HttpResponse OgcApi::Route(const Asked& asked) const {
  const std::string rest = asked.target.path.substr(std::string_view(kOgcAddress).size());
  if (rest.rfind(kCollectionPrefix, 0) == 0) {
    return RouteCollection(asked, rest.substr(kCollectionPrefix.size()));
  }
  RefuseQueryParameters(asked.target);
  if (rest.empty() || rest == "/")
    return JsonAnswer(OgcLandingPage(asked.base, source_.options.title));
  if (rest == "/conformance") return JsonAnswer(OgcConformance());
  if (rest == "/api") {
    return JsonAnswer(OgcOpenApi(asked.base, source_.options.title, Collections(asked.sees)),
                      kOpenApiType);
  }
  if (rest == "/collections") {
    return JsonAnswer(OgcCollections(asked.base, Collections(asked.sees)));
  }
  return NotThere("there is nothing at this address");
}

/// "hazards", "hazards/items" or "hazards/items/ID".
HttpResponse OgcApi::RouteCollection(const Asked& asked, const std::string& rest) const {
  const std::string id = rest.substr(0, rest.find('/'));
  const auto collections = Collections(asked.sees);
  const auto collection = std::find_if(collections.begin(), collections.end(),
                                       [&](const auto& other) { return other.id == id; });
  if (collection == collections.end()) {
    return NotThere("there is no collection " + Quoted(id) + ", /ogc/collections has all");
  }
  const std::string below = rest.substr(id.size());
  if (below == kItemsEnding) return Items(asked, id);
  RefuseQueryParameters(asked.target);
  if (below.empty()) return JsonAnswer(OgcCollectionJson(asked.base, *collection));
  if (below.rfind(kItemsEnding, 0) == 0 && below[kItemsEnding.size()] == '/') {
    return Item(asked, id, below.substr(kItemsEnding.size() + 1));
  }
  return NotThere("there is nothing at this address");
}

std::vector<OgcCollection> OgcApi::Collections(const Visibility& sees) const {
  std::vector<OgcCollection> collections;
  if (sees.told) {
    collections.push_back({kHazards, "Hazards", "Hazards on the road, as points."});
  }
  if (sees.candidates) {
    collections.push_back(
        {kMapChanges, "Map changes", "Objects beside the road that came or went, as points."});
  }
  if (sees.told && source_.zone.streets() != nullptr) {
    collections.push_back({kStreets, "Streets with hazards",
                           "Ways of OpenStreetMap on which hazards lie, with their counts."});
  }
  return collections;
}

zone::Walk<zone::HazardState> OgcApi::HazardWalk(const Visibility& sees) const {
  zone::Walk<zone::HazardState> walk;
  walk.until = source_.zone.Sequence();
  for (const zone::HazardState state : zone::StatesOnMap()) {
    if (sees.candidates || zone::IsTold(state)) walk.states.insert(state);
  }
  return walk;
}

bool OgcApi::MaySee(const zone::Hazard& hazard, const Visibility& sees) const {
  return sees.candidates || (zone::IsTold(hazard.state) && hazard.announced_sequence != 0);
}

HttpResponse OgcApi::Items(const Asked& asked, const std::string& collection) const {
  const OgcQuery query = ParseOgcQuery(asked.target);
  if (collection == kHazards) return Hazards(asked, query);
  return collection == kMapChanges ? MapChanges(asked, query) : Streets(asked, query);
}

HttpResponse OgcApi::Hazards(const Asked& asked, const OgcQuery& query) const {
  auto walk = HazardWalk(asked.sees);
  walk.box = query.box;
  walk.after = query.cursor;
  return WalkAnswer(
      FeatureWriter(asked.server, asked.target, asked.now_ns), asked.self, std::move(walk),
      query.limit,
      [this](const auto& where, std::size_t limit) {
        return source_.zone.ReadHazards(where, limit);
      },
      [this, query, sees = asked.sees](const zone::Hazard& hazard) {
        return MaySee(hazard, sees) && WasSeenIn(query, hazard);
      },
      [this](const zone::Hazard& hazard) {
        return HazardFeature(hazard, source_.catalogue, source_.zone.WordsOf(hazard));
      });
}

HttpResponse OgcApi::MapChanges(const Asked& asked, const OgcQuery& query) const {
  zone::Walk<zone::MapChangeState> walk;
  walk.box = query.box;
  walk.after = query.cursor;
  walk.until = source_.zone.Sequence();
  walk.states = zone::OpenStates();
  return WalkAnswer(
      FeatureWriter(asked.server, asked.target, asked.now_ns), asked.self, std::move(walk),
      query.limit,
      [this](const auto& where, std::size_t limit) {
        return source_.zone.ReadMapChanges(where, limit);
      },
      [query](const zone::MapChangeFeature& change) { return WasSeenIn(query, change); },
      MapChangeGeoJson);
}

/// All hazards are counted before the first street is written.
HttpResponse OgcApi::Streets(const Asked& asked, const OgcQuery& query) const {
  auto slot = slots_.Take();
  if (!slot) return MakeBusyAnswer("too many of these pages are being made now");
  auto pieces = [this, slot = std::move(slot),
                 writer = FeatureWriter(asked.server, asked.target, asked.now_ns),
                 self = asked.self, sees = asked.sees, query, walk = HazardWalk(asked.sees),
                 counts = std::make_shared<StreetCounts>(*source_.zone.streets()),
                 is_counted = false, after = query.cursor](std::string& piece) mutable {
    if (!is_counted) {
      const auto page = source_.zone.ReadHazards(walk, kFeaturesPerRead);
      for (const zone::Hazard& hazard : page.items) {
        if (MaySee(hazard, sees)) counts->Add(hazard);
      }
      walk.after = page.sequence;
      is_counted = page.is_last;
      return true;
    }
    writer.Begin(piece);
    for (std::size_t i = 0; i < kFeaturesPerRead; ++i) {
      std::uint64_t id = 0;
      const Json street = counts->Next(query, after, id);
      const bool has_more = !street.is_null() && writer.count() == query.limit;
      if (street.is_null() || has_more) {
        writer.End(self, has_more, piece);
        return false;
      }
      after = id;
      writer.Add(street, id, piece);
    }
    return true;
  };
  return PiecesAnswer(std::move(pieces), kFeatureType);
}

HttpResponse OgcApi::Item(const Asked& asked, const std::string& collection,
                          const std::string& id) const {
  Json feature = FindItem(asked, collection, id);
  if (feature.is_null()) return NotThere("there is no feature " + Quoted(id) + " in it");
  const std::string above = asked.base + "/collections/" + collection;
  feature["links"] =
      Json::array({OgcLink(asked.server + asked.target.path, "self", kFeatureType, "This feature"),
                   OgcLink(above, "collection", "application/json", "Its collection")});
  return JsonAnswer(feature, kFeatureType);
}

Json OgcApi::FindItem(const Asked& asked, const std::string& collection,
                      const std::string& id) const {
  if (collection == kHazards) return FindHazard(asked, id);
  if (collection == kStreets) return FindStreet(asked, id);
  const auto uuid = Uuid::Parse(id);
  const auto change = uuid ? source_.zone.FindMapChange(*uuid) : std::nullopt;
  return change && zone::IsOpen(change->state) ? MapChangeGeoJson(*change) : Json(nullptr);
}

Json OgcApi::FindHazard(const Asked& asked, const std::string& id) const {
  const auto uuid = Uuid::Parse(id);
  const auto hazard = uuid ? source_.zone.Find(*uuid) : std::nullopt;
  if (!hazard || !zone::IsOnMap(hazard->state) || !MaySee(*hazard, asked.sees)) return nullptr;
  return HazardFeature(*hazard, source_.catalogue, source_.zone.WordsOf(*hazard));
}

Json OgcApi::FindStreet(const Asked& asked, const std::string& id) const {
  const auto way = WholeNumber(id);
  StreetCounts counts(*source_.zone.streets());
  auto walk = HazardWalk(asked.sees);
  if (way) walk.box = counts.ReachOf(*way);
  if (!walk.box) return nullptr;
  for (bool is_last = false; !is_last;) {
    const auto page = source_.zone.ReadHazards(walk, kFeaturesPerRead);
    for (const zone::Hazard& hazard : page.items) {
      if (MaySee(hazard, asked.sees)) counts.Add(hazard);
    }
    walk.after = page.sequence;
    is_last = page.is_last;
  }
  return counts.Find(*way);
}

}  // namespace livemap::web
