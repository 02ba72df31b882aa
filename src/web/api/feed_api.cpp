#include "web/api/feed_api.h"

#include <array>
#include <cstddef>
#include <string_view>
#include <utility>

#include "web/access/access.h"
#include "web/feeds/formats/cifs_feed.h"
#include "web/feeds/formats/csv_feed.h"
#include "web/feeds/formats/datex_feed.h"
#include "web/feeds/formats/denm_feed.h"
#include "web/feeds/formats/georss_feed.h"
#include "web/feeds/formats/gpx_feed.h"
#include "web/feeds/formats/wzdx_feed.h"
#include "web/http/server_address.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

constexpr std::size_t kHazardsPerRead = 128;
constexpr std::string_view kDenmPrefix = "/feeds/denm/";

template <typename Format>
std::shared_ptr<FeedFormat> NewFormat() {
  return std::make_shared<Format>();
}

struct Feed {
  const char* address;
  const char* title;
  const char* type;
  FeedParameters parameters;
  /// Only of hazards of which drivers are told, whoever asks.
  bool for_drivers;
  bool gathers;  ///< It writes nothing before it has all hazards.
  std::shared_ptr<FeedFormat> (*make)();
};

constexpr std::array<Feed, 7> kFeeds{{
    {"/feeds/wzdx.geojson",
     "Work zones (WZDx 4.2)",
     WzdxFeed::kType,
     {},
     true,
     true,
     NewFormat<WzdxFeed>},
    {"/feeds/cifs.json",
     "Incidents (Waze CIFS)",
     CifsFeed::kType,
     {},
     true,
     false,
     NewFormat<CifsFeed>},
    {"/feeds/srti.xml",
     "Safety-related traffic information (DATEX II v3)",
     DatexFeed::kType,
     {},
     true,
     false,
     NewFormat<DatexFeed>},
    {"/feeds/denm.ndjson",
     "Hazards as ETSI DENM in JSON",
     DenmFeed::kType,
     {false, true},
     true,
     false,
     NewFormat<DenmFeed>},
    {"/feeds/hazards.atom",
     "Hazards (Atom with GeoRSS)",
     GeoRssFeed::kType,
     {true, false},
     false,
     false,
     NewFormat<GeoRssFeed>},
    {"/feeds/hazards.csv",
     "Hazards (CSV)",
     CsvFeed::kType,
     {true, false},
     false,
     false,
     NewFormat<CsvFeed>},
    {"/feeds/hazards.gpx",
     "Hazards (GPX waypoints)",
     GpxFeed::kType,
     {true, false},
     false,
     false,
     NewFormat<GpxFeed>},
}};

HttpResponse NoFeed() { return MakeErrorAnswer(404, "there is no feed at this address"); }

/// The states that a feed looks at; empty with `since`: any, because what ended is told too.
zone::HazardStates StatesOf(const FeedQuery& query, bool all) {
  if (query.since) return {};
  zone::HazardStates states;
  for (const zone::HazardState state : query.states.empty() ? zone::StatesOnMap() : query.states) {
    if (all || zone::IsTold(state)) states.insert(state);
  }
  return states;
}

/// A browser that opens these saves them.
void NameTheFile(const std::string& address, HttpResponse& answer) {
  const bool is_table = address == "/feeds/hazards.csv" || address == "/feeds/hazards.gpx";
  if (!is_table) return;
  answer.headers.emplace_back(
      "Content-Disposition",
      "attachment; filename=\"" + address.substr(std::string_view("/feeds/").size()) + '"');
}

}  // namespace

FeedApi::FeedApi(FeedSource source) : source_(std::move(source)), tags_(SystemNs()) {}

HttpResponse FeedApi::Answer(const RequestTarget& target, const HttpRequest& question,
                             const Visibility& sees) const {
  if (target.path == kFeedAddress) {
    RefuseQueryParameters(target);
    return List(question);
  }
  if (!sees.told) return LogInFirst();
  if (target.path.rfind(kDenmPrefix, 0) == 0) {
    RefuseQueryParameters(target);
    return OneDenm(target.path.substr(kDenmPrefix.size()));
  }
  for (const Feed& feed : kFeeds) {
    if (target.path != feed.address) continue;
    FeedQuery query = ParseFeedQuery(target, feed.parameters);
    const bool all = sees.candidates && !feed.for_drivers;
    if (!query.since && StatesOf(query, all).empty()) return LogInFirst();
    const FeedHead head = HeadOf(question);
    const std::string tag =
        tags_.TagOf(source_.zone.Sequence(), head.now_ns, head.base, question, sees);
    if (auto unchanged = ChangeTags::Unchanged(tag, question)) return *std::move(unchanged);
    auto slot = feed.gathers ? slots_.Take() : nullptr;
    if (feed.gathers && !slot) return MakeBusyAnswer("too many of these feeds are being made now");
    HttpResponse answer =
        Stream(feed.make(), feed.type, head, std::move(query), all, std::move(slot));
    NameTheFile(target.path, answer);
    return ChangeTags::Tagged(std::move(answer), tag);
  }
  return NoFeed();
}

HttpResponse FeedApi::List(const HttpRequest& question) const {
  const std::string base = ServerAddress(source_.options, question);
  Json feeds = Json::array();
  for (const Feed& feed : kFeeds) {
    feeds.push_back({{"title", feed.title}, {"href", base + feed.address}, {"type", feed.type}});
  }
  feeds.push_back(
      {{"title", "Features (OGC API)"}, {"href", base + "/ogc"}, {"type", "application/json"}});
  Json answer;
  answer["feeds"] = std::move(feeds);
  return JsonAnswer(answer);
}

HttpResponse FeedApi::OneDenm(const std::string& id) const {
  const auto uuid = Uuid::Parse(id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  const auto hazard = source_.zone.Find(*uuid);
  if (!hazard || hazard->announced_sequence == 0) {
    return MakeErrorAnswer(404, "drivers were told of no hazard with this id");
  }
  return JsonAnswer(DenmJson(MakeHazard(*hazard, source_.now_ns())));
}

FeedHead FeedApi::HeadOf(const HttpRequest& question) const {
  FeedHead head;
  head.base = ServerAddress(source_.options, question);
  head.self = head.base + question.target;
  head.publisher = source_.options.feed_publisher.empty() ? source_.options.title
                                                          : source_.options.feed_publisher;
  head.country = source_.options.feed_country;
  head.now_ns = source_.now_ns();
  return head;
}

FeedHazard FeedApi::MakeHazard(const zone::Hazard& hazard, std::int64_t now_ns) const {
  return MakeFeedHazard(hazard, source_.catalogue, source_.zone.WordsOf(hazard), now_ns);
}

HttpResponse FeedApi::Stream(std::shared_ptr<FeedFormat> format, const char* type,
                             const FeedHead& head, FeedQuery query, bool all,
                             std::shared_ptr<void> slot) const {
  zone::Walk<zone::HazardState> walk;
  walk.box = query.box;
  walk.after = query.since.value_or(0);
  walk.until = source_.zone.Sequence();  // Before the first read.
  walk.states = StatesOf(query, all);
  auto pieces = [this, format = std::move(format), head, query = std::move(query),
                 walk = std::move(walk), all, slot = std::move(slot), is_begun = false,
                 is_read = false](std::string& piece) mutable {
    if (!is_begun) format->Begin(head, piece);
    is_begun = true;
    if (is_read) return format->End(piece);
    const auto page = source_.zone.ReadHazards(walk, kHazardsPerRead);
    for (const zone::Hazard& hazard : page.items) {
      if (!all && hazard.announced_sequence == 0) continue;
      if (!query.classes.empty() && query.classes.count(hazard.class_name) == 0) continue;
      format->Add(MakeHazard(hazard, head.now_ns), piece);
    }
    walk.after = page.sequence;
    is_read = page.is_last;
    return is_read ? format->End(piece) : true;
  };
  return PiecesAnswer(std::move(pieces), type);
}

}  // namespace livemap::web
