#include "region/zone_reply.h"

#include <algorithm>
#include <array>
#include <map>
#include <string_view>
#include <utility>

#include "region/region_map.h"

namespace livemap::region {
namespace {

using ReplyJson = nlohmann::json;

constexpr std::string_view kPicturePrefix = "/images/";
constexpr std::array<const char*, 4> kCounts{"opened", "confirmed", "rejected", "repaired"};
constexpr std::size_t kMaxMergedStreets = 100;
/// Beyond it no zone counts.
constexpr std::uint64_t kMaxCounted = std::uint64_t{1} << 40;

bool NamesAHazard(const std::string& key) {
  return key == "id" || key == "hazard" || key == "subject";
}

const ReplyJson& ListOf(const ReplyJson& answer, const char* name) {
  static const ReplyJson kNone = ReplyJson::array();
  if (!answer.is_object()) return kNone;
  const auto list = answer.find(name);
  return list != answer.end() && list->is_array() ? *list : kNone;
}

std::string TextOf(const ReplyJson& object, const char* name) {
  if (!object.is_object()) return "";
  const auto text = object.find(name);
  return text != object.end() && text->is_string() ? text->get<std::string>() : "";
}

/// The zone's own id of the hazard that stands under `name`, which becomes the region's.
void TakeHazard(const std::string& zone, const char* name, ReplyJson& entry,
                std::vector<NamedHazard>& named) {
  const auto hazard = Uuid::Parse(TextOf(entry, name));
  if (!hazard) return;
  named.push_back({zone, *hazard});
  entry[name] = RegionHazardId(zone, *hazard).ToString();
}

/// What is counted of one class, street or week, or of all.
struct Sums {
  std::array<std::uint64_t, kCounts.size()> counts{};
  std::string label;  ///< Of a class.

  void Add(const ReplyJson& line) {
    if (!line.is_object()) return;
    for (std::size_t i = 0; i < kCounts.size(); ++i) {
      const auto count = line.find(kCounts[i]);
      if (count == line.end() || !count->is_number_unsigned()) continue;
      counts[i] += std::min(count->get<std::uint64_t>(), kMaxCounted);
    }
  }

  void Write(web::Json& line) const {
    for (std::size_t i = 0; i < kCounts.size(); ++i) line[kCounts[i]] = counts[i];
    line["median_repair_s"] = nullptr;
    line["why_no_median_repair"] = "each zone knows its own alone";
    const auto confirmed = static_cast<double>(counts[1]);
    const auto judged = static_cast<double>(counts[1] + counts[2]);
    line["precision"] = judged > 0 ? web::Json(web::Rounded(confirmed / judged, 4)) : web::Json();
    line["why_no_precision"] =
        judged > 0 ? web::Json() : web::Json("no official has judged one in this time");
  }
};

using SumsByKey = std::map<std::string, Sums>;

SumsByKey SumsOf(const std::vector<ZonePart>& parts, const char* list, const char* key) {
  SumsByKey sums;
  for (const ZonePart& part : parts) {
    for (const ReplyJson& line : ListOf(part.answer, list)) {
      Sums& sum = sums[TextOf(line, key)];
      sum.Add(line);
      if (sum.label.empty()) sum.label = TextOf(line, "label");
    }
  }
  return sums;
}

/// The earliest of the zones' times under `name`, RFC 3339.
web::Json EarliestOf(const std::vector<ZonePart>& parts, const char* name) {
  std::string earliest;
  for (const ZonePart& part : parts) {
    const std::string time = TextOf(part.answer, name);
    if (!time.empty() && (earliest.empty() || time < earliest)) earliest = time;
  }
  return earliest.empty() ? web::Json() : web::Json(earliest);
}

}  // namespace

std::string RegionPictureAddress(const std::string& zone_address, const std::string& zone) {
  return zone_address + "?zone=" + zone;
}

void NameByRegion(const std::string& zone, ReplyJson& answer) {
  if (answer.is_array()) {
    for (ReplyJson& item : answer) NameByRegion(zone, item);
  }
  if (!answer.is_object()) return;
  for (auto& [key, value] : answer.items()) {
    if (value.is_structured()) NameByRegion(zone, value);
    if (!value.is_string()) continue;
    const std::string text = value.get<std::string>();
    if (key == "image" && text.compare(0, kPicturePrefix.size(), kPicturePrefix) == 0) {
      value = RegionPictureAddress(text, zone);
    } else if (NamesAHazard(key)) {
      if (const auto hazard = Uuid::Parse(text)) value = RegionHazardId(zone, *hazard).ToString();
    }
  }
}

web::Json MergedDecisions(const std::vector<ZonePart>& parts, std::size_t limit,
                          std::vector<NamedHazard>& named) {
  std::vector<ReplyJson> all;
  for (const ZonePart& part : parts) {
    for (const ReplyJson& told : ListOf(part.answer, "decisions")) {
      if (TextOf(told, "time").empty()) continue;
      ReplyJson decision = told;
      if (TextOf(decision, "about") == "hazard") {
        TakeHazard(part.zone, "subject", decision, named);
      }
      decision["zone"] = part.zone;
      all.push_back(std::move(decision));
    }
  }
  // One form of RFC 3339 in UTC: texts are in the order of times.
  std::stable_sort(all.begin(), all.end(), [](const ReplyJson& a, const ReplyJson& b) {
    return TextOf(a, "time") > TextOf(b, "time");
  });
  const bool is_cut = all.size() > limit;
  if (is_cut) all.resize(limit);
  web::Json answer;
  answer["decisions"] = web::Json::array();
  for (const ReplyJson& decision : all) answer["decisions"].emplace_back(decision);
  answer["next"] = nullptr;
  answer["truncated"] = is_cut;
  return answer;
}

web::Json MergedAssignments(const std::vector<ZonePart>& parts, std::vector<NamedHazard>& named) {
  web::Json list = web::Json::array();
  bool is_cut = false;
  for (const ZonePart& part : parts) {
    for (const ReplyJson& told : ListOf(part.answer, "assignments")) {
      if (!Uuid::Parse(TextOf(told, "hazard"))) continue;
      is_cut = list.size() == kMaxMergedAssignments;
      if (is_cut) break;
      ReplyJson assignment = told;
      TakeHazard(part.zone, "hazard", assignment, named);
      assignment["zone"] = part.zone;
      list.emplace_back(assignment);
    }
  }
  return {{"assignments", std::move(list)}, {"truncated", is_cut}};
}

web::Json MergedStatistics(const std::vector<ZonePart>& parts) {
  web::Json answer;
  answer["from"] = EarliestOf(parts, "from");
  answer["to"] = EarliestOf(parts, "to");
  Sums all;
  for (const ZonePart& part : parts) {
    if (part.answer.is_object() && part.answer.contains("all")) all.Add(part.answer["all"]);
  }
  all.Write(answer["all"]);
  web::Json& classes = answer["classes"] = web::Json::array();
  for (const auto& [name, sums] : SumsOf(parts, "classes", "class")) {
    web::Json line{{"class", name}, {"label", sums.label}};
    sums.Write(line);
    classes.push_back(std::move(line));
  }
  const SumsByKey by_street = SumsOf(parts, "streets", "street");
  // The streets with the most first.
  std::vector<std::pair<std::string, Sums>> streets(by_street.begin(), by_street.end());
  std::stable_sort(streets.begin(), streets.end(), [](const auto& a, const auto& b) {
    return a.second.counts[0] > b.second.counts[0];
  });
  bool is_cut = streets.size() > kMaxMergedStreets;
  if (is_cut) streets.resize(kMaxMergedStreets);
  web::Json& of_streets = answer["streets"] = web::Json::array();
  for (const auto& [street, sums] : streets) {
    web::Json line{{"street", street.empty() ? web::Json() : web::Json(street)}};
    sums.Write(line);
    of_streets.push_back(std::move(line));
  }
  for (const ZonePart& part : parts) {
    is_cut = is_cut ||
             (part.answer.is_object() && part.answer.value("streets_cut", ReplyJson()) == true);
  }
  answer["streets_cut"] = is_cut;
  web::Json& weeks = answer["weeks"] = web::Json::array();
  for (const auto& [week, sums] : SumsOf(parts, "weeks", "week")) {
    web::Json line{{"week", week}};
    sums.Write(line);
    weeks.push_back(std::move(line));
  }
  return answer;
}

}  // namespace livemap::region
