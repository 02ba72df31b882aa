#include "web/officials/desk_api.h"

#include <algorithm>
#include <optional>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "common/utc_text.h"
#include "web/api/hazard_api.h"
#include "web/json/json.h"
#include "web/officials/desk_body.h"

namespace livemap::web {
namespace {

constexpr std::string_view kSightingsEnding = "/sightings";
constexpr std::string_view kFrameEnding = "/frame";
constexpr std::int64_t kWeekNs = 7 * 86'400'000'000'000;
constexpr std::size_t kMaxSightings = 200;
constexpr std::size_t kMaxStreets = 100;
constexpr std::size_t kDecisionsPerRead = 1000;
constexpr std::size_t kDeskHazardsPerRead = 500;

/// The id in "/api/v1/hazards/UUID" + `ending`; none for any other address.
std::optional<std::string> HazardBefore(const std::string& path, std::string_view ending) {
  const std::string_view hazards(kHazardAddress);
  const std::string_view all(path);
  if (path.size() <= hazards.size() + ending.size() + 1) return std::nullopt;
  if (all.substr(0, hazards.size()) != hazards || path[hazards.size()] != '/') return std::nullopt;
  if (all.substr(path.size() - ending.size()) != ending) return std::nullopt;
  const std::size_t begin = hazards.size() + 1;
  return path.substr(begin, path.size() - begin - ending.size());
}

const char* AnswerName(protocol::PollAnswer::Answer answer) {
  switch (answer) {
    case protocol::PollAnswer::Answer::kYes:
      return "yes";
    case protocol::PollAnswer::Answer::kNo:
      return "no";
    case protocol::PollAnswer::Answer::kCantSee:
      break;
  }
  return "cant_see";
}

void AddCounts(const zone::DeskCounts& counts, Json& json) {
  json["opened"] = counts.opened;
  json["confirmed"] = counts.confirmed;
  json["rejected"] = counts.rejected;
  json["repaired"] = counts.repaired;
  const auto median_s = counts.MedianRepairS();
  json["median_repair_s"] = median_s ? Json(Rounded(*median_s, 1)) : Json();
  json["why_no_median_repair"] = median_s ? Json() : Json("none was repaired in this time");
  const auto precision = counts.Precision();
  json["precision"] = precision ? Json(Rounded(*precision, 4)) : Json();
  json["why_no_precision"] = precision ? Json() : Json("no official has judged one in this time");
}

}  // namespace

bool DeskApi::Has(const std::string& path) {
  return path == "/api/v1/assignments" || path == "/api/v1/statistics" ||
         HazardBefore(path, kSightingsEnding) || HazardBefore(path, kFrameEnding);
}

HttpResponse DeskApi::Answer(const RequestTarget& target) const {
  if (target.path == "/api/v1/statistics") return Statistics(ParseStatisticsQuery(target).weeks);
  RefuseQueryParameters(target);
  if (target.path == "/api/v1/assignments") return Assignments();
  if (const auto id = HazardBefore(target.path, kFrameEnding)) return Frame(*id);
  return Sightings(HazardBefore(target.path, kSightingsEnding).value_or(""));
}

HttpResponse DeskApi::Assignments() const {
  const std::int64_t now_ns = zone_.NowNs();
  Json answer;
  Json& list = answer["assignments"] = Json::array();
  for (const zone::Assignment& assignment : zone_.Assignments()) {
    list.push_back({{"hazard", assignment.hazard.ToString()},
                    {"team", assignment.team},
                    {"due", assignment.due_ns == 0 ? Json() : Json(UtcDay(assignment.due_ns))},
                    {"overdue", assignment.IsOverdue(now_ns)},
                    {"since", Rfc3339(assignment.since_ns)},
                    {"decision_id", assignment.decision}});
  }
  return JsonAnswer(answer);
}

HttpResponse DeskApi::Sightings(const std::string& id) const {
  const auto uuid = Uuid::Parse(id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  if (!zone_.Find(*uuid)) return MakeErrorAnswer(404, "the zone knows no hazard with this id");
  Json answer;
  answer["id"] = id;
  Json& list = answer["sightings"] = Json::array();
  for (const zone::SightingRecord& sighting : zone_.Sightings(*uuid, kMaxSightings)) {
    const bool is_kept =
        !sighting.image_sha256.empty() && zone_.ImagePath(sighting.image_sha256).has_value();
    const char* why_not = sighting.image_sha256.empty() ? "no picture came with this report"
                                                        : "the picture is no longer kept";
    list.push_back({{"time", Rfc3339(sighting.stamp_ns)},
                    {"confidence", Rounded(sighting.confidence, 4)},
                    {"position",
                     {Rounded(sighting.position.longitude_deg, 7),
                      Rounded(sighting.position.latitude_deg, 7)}},
                    {"image", is_kept ? Json("/images/" + sighting.image_sha256) : Json()},
                    {"why_no_image", is_kept ? Json() : Json(why_not)},
                    {"merged", sighting.hazard != *uuid}});
  }
  answer["truncated"] = list.size() == kMaxSightings;
  Json& answers = answer["answers"] = Json::array();
  for (const zone::AnswerPicture& picture : zone_.AnswerPictures(*uuid, kMaxSightings)) {
    answers.push_back(PictureOf(picture));
  }
  return JsonAnswer(answer);
}

Json DeskApi::PictureOf(const zone::AnswerPicture& picture) const {
  const bool is_kept = zone_.ImagePath(picture.image_sha256).has_value();
  return {{"time", Rfc3339(picture.stamp_ns)},
          {"answer", AnswerName(picture.answer)},
          {"confidence", Rounded(picture.confidence, 4)},
          {"image", is_kept ? Json("/images/" + picture.image_sha256) : Json()},
          {"why_no_image", is_kept ? Json() : Json("the picture is no longer kept")},
          {"whole_frame", picture.decision != 0},
          {"decision_id", picture.decision != 0 ? Json(picture.decision) : Json()}};
}

HttpResponse DeskApi::Frame(const std::string& id) const {
  const auto uuid = Uuid::Parse(id);
  if (!uuid) throw BadRequest("the hazard's id is no UUID");
  if (!zone_.Find(*uuid)) return MakeErrorAnswer(404, "the zone knows no hazard with this id");
  const auto status = zone_.FrameOf(*uuid);
  Json answer;
  answer["id"] = id;
  answer["state"] = "none";
  for (const char* key : {"asked", "until", "official", "decision_id", "picture"}) {
    answer[key] = nullptr;
  }
  if (!status) return JsonAnswer(answer);
  answer["state"] = zone::FrameStateName(status->state);
  answer["asked"] = Rfc3339(status->request.asked_ns);
  answer["until"] = Rfc3339(status->request.until_ns);
  answer["official"] = status->request.official;
  answer["decision_id"] = status->request.decision;
  if (status->picture) answer["picture"] = PictureOf(*status->picture);
  return JsonAnswer(answer);
}

void DeskApi::CountHazards(zone::DeskStatistics& statistics, std::int64_t from_ns) const {
  const std::set<std::string> decided = statistics.DecidedHazards();
  zone::Walk<zone::HazardState> walk;  // Of every state.
  walk.until = zone_.Sequence();
  for (bool is_last = false; !is_last;) {
    const auto page = zone_.ReadHazards(walk, kDeskHazardsPerRead);
    for (const zone::Hazard& hazard : page.items) {
      const bool counts =
          hazard.first_seen_ns >= from_ns || decided.count(hazard.uuid.ToString()) != 0;
      if (counts) statistics.AddHazard(hazard, zone_.WordsOf(hazard).street);
    }
    walk.after = page.sequence;
    is_last = page.is_last;
  }
}

HttpResponse DeskApi::Statistics(std::size_t weeks) const {
  const std::int64_t now_ns = zone_.NowNs();
  const std::int64_t from_ns =
      zone::WeekOf(now_ns) - static_cast<std::int64_t>(weeks - 1) * kWeekNs;
  zone::DeskStatistics statistics(from_ns);
  for (std::uint64_t before = UINT64_MAX;;) {
    const auto decisions = zone_.Decisions(before, kDecisionsPerRead);
    for (const zone::DecisionRecord& decision : decisions) statistics.AddDecision(decision);
    if (decisions.size() < kDecisionsPerRead || decisions.back().at_ns < from_ns) break;
    before = decisions.back().id;
  }
  CountHazards(statistics, from_ns);

  Json answer;
  answer["from"] = Rfc3339(from_ns);
  answer["to"] = Rfc3339(now_ns);
  AddCounts(statistics.all(), answer["all"]);
  Json& classes = answer["classes"] = Json::array();
  for (const auto& [class_name, counts] : statistics.by_class()) {
    Json line{{"class", class_name}, {"label", catalogue_.Get(class_name).label}};
    AddCounts(counts, line);
    classes.push_back(std::move(line));
  }
  // The streets with the most first.
  std::vector<std::pair<std::string, const zone::DeskCounts*>> streets;
  for (const auto& [street, counts] : statistics.by_street()) streets.emplace_back(street, &counts);
  std::stable_sort(streets.begin(), streets.end(), [](const auto& a, const auto& b) {
    return a.second->opened > b.second->opened;
  });
  answer["streets_cut"] = streets.size() > kMaxStreets;
  if (streets.size() > kMaxStreets) streets.resize(kMaxStreets);
  Json& of_streets = answer["streets"] = Json::array();
  for (const auto& [street, counts] : streets) {
    Json line{{"street", street.empty() ? Json() : Json(street)}};
    AddCounts(*counts, line);
    of_streets.push_back(std::move(line));
  }
  Json& of_weeks = answer["weeks"] = Json::array();
  for (const auto& [week_ns, counts] : statistics.by_week()) {
    Json line{{"week", UtcDay(week_ns)}};
    AddCounts(counts, line);
    of_weeks.push_back(std::move(line));
  }
  return JsonAnswer(answer);
}

}  // namespace livemap::web
