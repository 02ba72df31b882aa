#include "region/region_desk.h"

#include <algorithm>
#include <cctype>
#include <memory>
#include <string_view>

#include "common/error.h"
#include "region/zone_answer.h"
#include "web/api/query.h"
#include "web/http/page_answer.h"
#include "web/http/request_body.h"
#include "web/officials/desk_body.h"

namespace livemap::region {
namespace {

using web::HttpRequest;
using web::HttpResponse;
using web::MakeErrorAnswer;

constexpr std::string_view kDecisionsAddress = "/api/v1/decisions";
constexpr std::string_view kAssignmentsAddress = "/api/v1/assignments";
constexpr std::string_view kStatisticsAddress = "/api/v1/statistics";
constexpr std::string_view kHazardsPrefix = "/api/v1/hazards/";
constexpr std::string_view kPicturesPrefix = "/images/";
constexpr std::size_t kMaxPictureBytes = 8 << 20;
/// Of the answers of all zones to one question together.
constexpr std::size_t kMaxListsBytes = 64 << 20;
constexpr std::size_t kMaxListBytes = 1 << 20;
constexpr std::size_t kMinListBytes = 64 << 10;
constexpr int kRetryAfterS = 5;

bool StartsWithPrefix(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}

/// "UUID" and "/events" of "/api/v1/hazards/UUID/events"; the second may be empty.
std::pair<std::string, std::string> SplitHazardPath(const std::string& path) {
  const std::string rest = path.substr(kHazardsPrefix.size());
  const std::size_t slash = std::min(rest.find('/'), rest.size());
  return {rest.substr(0, slash), rest.substr(slash)};
}

bool IsAboutHazard(web::Decision decision) {
  return decision != web::Decision::kDistrust && decision != web::Decision::kTrust &&
         decision != web::Decision::kMapChange;
}

bool IsContentHash(std::string_view text) {
  constexpr std::size_t kSha256Digits = 64;
  return text.size() == kSha256Digits &&
         text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

HttpResponse UnknownToRegion() {
  return MakeErrorAnswer(404, "the region knows no hazard with this id");
}

HttpResponse ChangedSinceSeen() {
  HttpResponse answer = web::JsonAnswer(
      {{"error", "the hazard changed since it was seen; look at it again"}, {"changed", true}});
  answer.status = 409;
  return answer;
}

/// What a zone says went wrong, or nothing.
std::string SentenceOf(const orders::HttpAnswer& answer) {
  const auto json = nlohmann::json::parse(answer.body, nullptr, false);
  if (!json.is_object()) return "";
  const auto sentence = json.find("error");
  return sentence != json.end() && sentence->is_string() ? sentence->get<std::string>() : "";
}

/// Numbers of a zone's log mean nothing here. Null where the region has not followed the zone to
/// the hazard's state yet: then whoever decides by it is not asked for what was seen.
void PutRegionSequence(const RegionMap& map, nlohmann::json& feature) {
  const auto properties = feature.find("properties");
  if (properties == feature.end() || !properties->is_object()) return;
  const auto id = properties->find("id");
  const auto uuid = id != properties->end() && id->is_string() ? Uuid::Parse(id->get<std::string>())
                                                               : std::nullopt;
  const auto hazard = uuid ? map.Find(*uuid) : std::nullopt;
  const bool is_followed = hazard && properties->value("state", nlohmann::json()) ==
                                         zone::HazardStateName(hazard->state);
  (*properties)["sequence"] = is_followed ? nlohmann::json(hazard->sequence) : nlohmann::json();
}

/// Calls `done` with what `make` answers, whatever it throws.
void AnswerBy(const std::function<HttpResponse()>& make, const web::Site::Done& done) {
  HttpResponse answer;
  try {
    answer = make();
  } catch (const std::exception&) {
    answer = web::MakeBusyAnswer("the region does not answer");
  }
  done(std::move(answer));
}

}  // namespace

RegionDesk::RegionDesk(web::Access& access, Region& region,
                       const protocol::HazardCatalogue& catalogue)
    : access_(access), region_(region), hazards_(region.map(), catalogue), calls_(region) {
  for (std::size_t i = 0; i < region.zones(); ++i) zones_[region.zone(i).id] = i;
}

bool RegionDesk::IsAddress(const std::string& path) {
  if (web::ParseDecisionTarget(path)) return true;
  if (path == kDecisionsAddress || path == kAssignmentsAddress || path == kStatisticsAddress) {
    return true;
  }
  const bool is_hazard = StartsWithPrefix(path, kHazardsPrefix) && path != "/api/v1/hazards/points";
  return is_hazard || StartsWithPrefix(path, kPicturesPrefix);
}

void RegionDesk::Answer(const web::RequestTarget& target, const HttpRequest& question,
                        const Done& done) {
  const std::string& path = target.path;
  const auto decision = web::ParseDecisionTarget(path);
  if (question.method == "POST" && decision) {
    web::RefuseQueryParameters(target);
    return Decide(*decision, path, question, done);
  }
  if (!access_.PersonOf(question)) return done(web::LogInFirst());
  const bool is_official = access_.IsByOfficial(question);
  const Done told = [done, is_official](HttpResponse answer) {
    answer.by_official = is_official;
    done(std::move(answer));
  };
  if (StartsWithPrefix(path, kPicturesPrefix)) return ReadPicture(target, question, told);
  if (path == kDecisionsAddress) return ReadDecisions(target, told);
  if (path == kStatisticsAddress) {
    const std::size_t weeks = web::ParseStatisticsQuery(target).weeks;
    return ReadAll(path + "?weeks=" + std::to_string(weeks), MergedStatistics, told);
  }
  if (path == kAssignmentsAddress) {
    web::RefuseQueryParameters(target);
    return ReadAll(
        path,
        [this](const Parts& parts) {
          std::vector<NamedHazard> named;
          web::Json answer = MergedAssignments(parts, named);
          Remember(named);
          return answer;
        },
        told);
  }
  ReadHazard(target, told);
}

std::optional<RegionDesk::Place> RegionDesk::Find(const std::string& id) const {
  const auto uuid = Uuid::Parse(id);
  if (!uuid) throw web::BadRequest("the hazard's id is no UUID");
  auto origin = region_.map().OriginOf(*uuid);
  if (!origin) {
    const MutexLock lock(mutex_);
    const auto named = named_.find(*uuid);
    if (named != named_.end()) origin = named->second;
  }
  if (!origin) return std::nullopt;
  const auto zone = zones_.find(origin->zone);
  if (zone == zones_.end()) return std::nullopt;
  return Place{zone->second, *uuid, *std::move(origin)};
}

void RegionDesk::Remember(const std::vector<NamedHazard>& named) {
  const MutexLock lock(mutex_);
  for (const auto& [zone, hazard] : named) {
    const Uuid id = RegionHazardId(zone, hazard);
    if (!named_.emplace(id, HazardOrigin{zone, hazard}).second) continue;
    named_order_.push_back(id);
    if (named_order_.size() <= kMaxNamed) continue;
    named_.erase(named_order_.front());
    named_order_.pop_front();
  }
}

std::size_t RegionDesk::ZoneOfName(const std::string& name) const {
  const auto zone = zones_.find(name);
  if (zone != zones_.end()) return zone->second;
  throw web::BadRequest("zone " + web::Quoted(name) +
                        " is unknown, accepted are the zones of /api/v1/zones");
}

std::optional<HttpResponse> RegionDesk::Translate(const Place& place, web::Decision decision,
                                                  std::string& body) const {
  auto json = nlohmann::json::parse(body, nullptr, false);
  // What is no object the zone refuses in its own words.
  if (!json.is_object()) return std::nullopt;
  const auto seen = json.find("sequence");
  if (seen != json.end() && seen->is_number_unsigned()) {
    if (seen->get<std::uint64_t>() < place.origin.region_since) return ChangedSinceSeen();
    *seen = place.origin.zone_since;
  }
  const auto other = json.find("other");
  if (decision == web::Decision::kMerge && other != json.end() && other->is_string()) {
    const auto merged = Find(other->get<std::string>());
    if (!merged) return UnknownToRegion();
    if (merged->zone != place.zone) {
      return MakeErrorAnswer(409, "the other hazard is of " + NameOf(merged->zone) +
                                      ", accepted is one of " + NameOf(place.zone));
    }
    *other = merged->origin.hazard.ToString();
  }
  body = json.dump();
  return std::nullopt;
}

void RegionDesk::Decide(const web::DecisionTarget& target, const std::string& path,
                        const HttpRequest& question, const Done& done) {
  std::string official;
  if (auto refusal = access_.WhyNotOfficial(question, official)) return done(*std::move(refusal));
  const Done told = [done](HttpResponse answer) {
    answer.by_official = true;
    done(std::move(answer));
  };
  if (!IsAboutHazard(target.decision)) {
    return told(MakeErrorAnswer(
        404, "a region decides about hazards alone; about vehicles and map changes their zone"));
  }
  const bool has_body = !question.body.empty();
  if (has_body && !web::IsJsonType(question.content_type)) return told(web::WrongBodyType());
  const auto place = Find(target.id);
  if (!place) return told(UnknownToRegion());
  if (region_.zone(place->zone).token.empty()) {
    return told(MakeErrorAnswer(
        403, "the region has no token of " + NameOf(place->zone) + ", see --token"));
  }
  orders::HttpCall call;
  call.is_post = true;
  call.body = question.body;
  if (auto refusal = Translate(*place, target.decision, call.body)) {
    return told(*std::move(refusal));
  }
  call.url =
      std::string(kHazardsPrefix) + place->origin.hazard.ToString() + path.substr(path.rfind('/'));
  call.headers = {"X-LiveMap-On-Behalf-Of: " + official};
  // Else libcurl names the type of a form.
  call.headers.emplace_back(has_body ? "Content-Type: application/json" : "Content-Type:");
  call.max_answer_bytes = kMaxAnswerBytes;
  AskOne(
      place->zone, call,
      [this, place = *place](const orders::HttpAnswer& answer) {
        return Relay(place.zone, answer, true);
      },
      told);
}

void RegionDesk::AskOne(std::size_t zone, const orders::HttpCall& call,
                        const std::function<HttpResponse(const orders::HttpAnswer&)>& relay,
                        const Done& done) {
  const bool is_asked = calls_.Ask(zone, call, [relay, done](const orders::HttpAnswer& answer) {
    AnswerBy([&] { return relay(answer); }, done);
  });
  if (!is_asked) {
    done(web::MakeBusyAnswer(NameOf(zone) + " has not answered other requests yet", kRetryAfterS));
  }
}

/// A request that may have arrived is not said to have failed.
HttpResponse RegionDesk::Relay(std::size_t zone, const orders::HttpAnswer& answer,
                               bool is_post) const {
  const std::string name = NameOf(zone);
  if (answer.status == 0 && is_post && answer.was_sent) {
    return MakeErrorAnswer(504, name +
                                    " has not answered, and may have done it: look at the "
                                    "hazard's history before you try again");
  }
  if (answer.status == 0) return web::MakeBusyAnswer(name + " does not answer", kRetryAfterS);
  if (answer.status == 401) {
    return MakeErrorAnswer(502, name + " does not take the region's token, see --token");
  }
  if (answer.status == 403) {
    return MakeErrorAnswer(403, name + " refuses: " + SentenceOf(answer));
  }
  if (answer.status >= 500) {
    const std::string sentence = SentenceOf(answer);
    return web::MakeBusyAnswer(
        name + (sentence.empty() ? " answers with an error" : " says: " + sentence), kRetryAfterS);
  }
  HttpResponse told;
  try {
    if (!answer.error.empty() || answer.status / 100 == 3) throw Error(answer.error);
    nlohmann::json json = ParseAnswerJson(answer.body);
    NameByRegion(region_.zone(zone).id, json);
    const bool is_feature = json.is_object() && json.value("type", nlohmann::json()) == "Feature";
    if (is_feature) PutRegionSequence(region_.map(), json);
    told =
        web::JsonAnswer(web::Json(json), is_feature ? "application/geo+json" : "application/json");
  } catch (const std::exception&) {
    return MakeErrorAnswer(502, name + " answers what no zone does");
  }
  told.status = answer.status;
  if (answer.retry_after_s > 0) {
    told.headers.emplace_back(
        "Retry-After", std::to_string(static_cast<int>(std::min(answer.retry_after_s, 3600.0))));
  }
  return told;
}

void RegionDesk::ReadHazard(const web::RequestTarget& target, const Done& done) {
  const auto [id, below] = SplitHazardPath(target.path);
  orders::HttpCall call;
  call.max_answer_bytes = kMaxAnswerBytes;
  std::string parameters;
  if (below == "/events") {
    parameters = "?limit=" + std::to_string(web::ParseEventsQuery(target));
  } else if (below.empty() || below == "/sightings" || below == "/frame") {
    web::RefuseQueryParameters(target);
  } else if (web::ParseDecisionTarget(target.path)) {
    HttpResponse refusal = MakeErrorAnswer(405, "the method is not allowed, accepted is POST");
    refusal.headers.emplace_back("Allow", "POST");
    return done(std::move(refusal));
  } else {
    return done(MakeErrorAnswer(404, "there is nothing at this address"));
  }
  const auto place = Find(id);
  if (!place) return done(UnknownToRegion());
  call.url = std::string(kHazardsPrefix) + place->origin.hazard.ToString() + below + parameters;
  AskOne(
      place->zone, call,
      [this, zone = place->zone, is_itself = below.empty(),
       target](const orders::HttpAnswer& answer) {
        const bool is_down = answer.status == 0 || answer.status >= 500;
        // Its last state stays on the map, too.
        return is_itself && is_down ? hazards_.Answer(target, true) : Relay(zone, answer, false);
      },
      done);
}

void RegionDesk::ReadDecisions(const web::RequestTarget& target, const Done& done) {
  web::RequestTarget plain = target;
  std::string zone_name;
  const auto is_zone = [](const auto& parameter) { return parameter.first == "zone"; };
  const auto named = std::find_if(plain.parameters.begin(), plain.parameters.end(), is_zone);
  if (named != plain.parameters.end()) {
    zone_name = named->second;
    plain.parameters.erase(named);
  }
  const web::DecisionsQuery query = web::ParseDecisionsQuery(plain);
  std::string url = std::string(kDecisionsAddress) + "?limit=" + std::to_string(query.limit);
  const auto merge = [this, limit = query.limit](const Parts& parts) {
    std::vector<NamedHazard> hazards;
    web::Json answer = MergedDecisions(parts, limit, hazards);
    Remember(hazards);
    return answer;
  };
  std::optional<std::size_t> zone;
  if (query.hazard) {
    const auto place = Find(query.hazard->ToString());
    if (!place) return done(UnknownToRegion());
    zone = place->zone;
    url += "&hazard=" + place->origin.hazard.ToString();
  } else if (!zone_name.empty()) {
    zone = ZoneOfName(zone_name);
    if (query.before != UINT64_MAX) url += "&before=" + std::to_string(query.before);
  } else if (query.before != UINT64_MAX) {
    throw web::BadRequest(
        "before counts the decisions of one zone, accepted is it beside zone=NAME");
  }
  if (!zone) return ReadAll(url, merge, done);
  orders::HttpCall call;
  call.url = std::move(url);
  call.max_answer_bytes = kMaxAnswerBytes;
  AskOne(
      *zone, call,
      [this, zone = *zone, merge](const orders::HttpAnswer& answer) {
        if (answer.status != 200 || !answer.error.empty()) return Relay(zone, answer, false);
        nlohmann::json told = ParseAnswerJson(answer.body);
        web::Json merged = merge({{region_.zone(zone).id, told}});
        const bool has_next = told.is_object() && told.contains("next");
        if (has_next && told["next"].is_number_unsigned()) merged["next"] = told["next"];
        return web::JsonAnswer(merged);
      },
      done);
}

void RegionDesk::ReadAll(const std::string& url,
                         const std::function<web::Json(const Parts& parts)>& merge,
                         const Done& done) {
  orders::HttpCall call;
  call.url = url;
  call.max_answer_bytes = std::clamp(kMaxListsBytes / std::max<std::size_t>(region_.zones(), 1),
                                     kMinListBytes, kMaxListBytes);
  calls_.AskAll(call, [this, merge, done](const ZoneCalls::Answers& answers) {
    AnswerBy(
        [&] {
          Parts parts;
          web::Json missing = web::Json::array();
          for (std::size_t i = 0; i < answers.size(); ++i) {
            const std::string& zone = region_.zone(i).id;
            try {
              const auto& answer = answers[i];
              if (!answer || answer->status != 200) throw Error("it has not answered");
              parts.push_back({zone, ParseAnswerJson(answer->body)});
            } catch (const Error&) {
              missing.push_back(zone);
            }
          }
          web::Json merged = merge(parts);
          merged["missing"] = std::move(missing);
          return web::JsonAnswer(merged);
        },
        done);
  });
}

void RegionDesk::ReadPicture(const web::RequestTarget& target, const HttpRequest& question,
                             const Done& done) {
  const std::string sha256 = target.path.substr(kPicturesPrefix.size());
  const bool is_named = target.parameters.size() == 1 && target.parameters[0].first == "zone";
  if (!is_named) throw web::BadRequest("the address is not accepted, accepted is ?zone=NAME");
  const std::size_t zone = ZoneOfName(target.parameters[0].second);
  if (!IsContentHash(sha256)) {
    return done(MakeErrorAnswer(404, "the zone has no picture of this name"));
  }
  orders::HttpCall call;
  call.url = target.path;
  call.max_answer_bytes = kMaxPictureBytes;
  AskOne(
      zone, call,
      [this, zone, sha256, question](const orders::HttpAnswer& answer) {
        if (answer.status != 200 || !answer.error.empty()) return Relay(zone, answer, false);
        constexpr std::string_view kJpegBegin = "\xFF\xD8\xFF";
        if (!StartsWithPrefix(answer.body, kJpegBegin)) {
          return MakeErrorAnswer(502, NameOf(zone) + " answers what no zone does");
        }
        auto picture =
            std::make_shared<std::vector<std::uint8_t>>(answer.body.begin(), answer.body.end());
        HttpResponse told =
            web::CacheableAnswer(std::move(picture), "image/jpeg", '"' + sha256 + '"',
                                 "private, max-age=3600", question);
        told.headers.emplace_back("Content-Security-Policy", "default-src 'none'; sandbox");
        return told;
      },
      done);
}

}  // namespace livemap::region
