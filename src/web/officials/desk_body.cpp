#include "web/officials/desk_body.h"

#include <array>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string_view>

#include "protocol/text_rules.h"

namespace livemap::web {
namespace {

constexpr std::size_t kMaxWeeks = 520;

using Body = nlohmann::json;

Body ParseDeskBody(const std::string& body, std::initializer_list<std::string_view> keys,
                   const std::string& accepted) {
  Body json = Body::parse(body, nullptr, false);
  if (!json.is_object()) throw BadRequest("the body is no JSON object, accepted is " + accepted);
  for (const auto& [key, value] : json.items()) {
    bool is_known = false;
    for (const std::string_view known : keys) is_known = is_known || key == known;
    if (!is_known) throw BadRequest("the body has an unknown key, accepted is " + accepted);
  }
  return json;
}

/// The text under the key; empty where there is none or it is null.
std::string TextOf(const Body& json, const char* key, std::size_t max_bytes) {
  const auto value = json.find(key);
  if (value == json.end() || value->is_null()) return "";
  const std::string accepted =
      ", accepted is printable text of 1 to " + std::to_string(max_bytes) + " bytes";
  if (!value->is_string()) throw BadRequest(std::string("the ") + key + " is no text" + accepted);
  const auto& text = value->get_ref<const std::string&>();
  if (protocol::IsAcceptableText(text, max_bytes)) return text;
  throw BadRequest(std::string("the ") + key + " of " + std::to_string(text.size()) +
                   " bytes is not accepted" + accepted);
}

std::string NeededText(const Body& json, const char* key, std::size_t max_bytes) {
  std::string text = TextOf(json, key, max_bytes);
  if (text.empty()) throw BadRequest(std::string("the body has no ") + key);
  return text;
}

zone::DeskAction ParseComment(const std::string& body) {
  const Body json = ParseDeskBody(body, {"text"}, R"({"text": TEXT})");
  zone::DeskAction action;
  action.kind = zone::DecisionKind::kComment;
  action.text = NeededText(json, "text", zone::kMaxDecisionTextBytes);
  return action;
}

zone::DeskAction ParseAssignment(const std::string& body) {
  constexpr char kAccepted[] =
      R"({"team": TEXT or null, "due": "YYYY-MM-DD" or null, "reason": TEXT})";
  const Body json = ParseDeskBody(body, {"team", "due", "reason"}, kAccepted);
  if (json.count("team") == 0) {
    throw BadRequest(std::string("the body has no team, accepted is ") + kAccepted);
  }
  zone::DeskAction action;
  action.kind = zone::DecisionKind::kAssign;
  action.team = protocol::Trimmed(TextOf(json, "team", zone::kMaxTeamBytes));
  action.text = TextOf(json, "reason", kMaxDecisionReasonBytes);
  const auto due = json.find("due");
  if (due == json.end() || due->is_null()) return action;
  const auto day = due->is_string() ? ParseDay(due->get_ref<const std::string&>())
                                    : std::optional<std::int64_t>();
  if (!day || action.team.empty()) {
    throw BadRequest("the due day is not accepted, accepted is YYYY-MM-DD beside a team");
  }
  action.due_ns = *day;
  return action;
}

zone::DeskAction ParseClass(const std::string& body) {
  const Body json = ParseDeskBody(body, {"class", "reason"}, R"({"class": TEXT, "reason": TEXT})");
  zone::DeskAction action;
  action.kind = zone::DecisionKind::kReclassHazard;
  action.class_name = NeededText(json, "class", zone::kMaxTeamBytes);
  action.text = TextOf(json, "reason", kMaxDecisionReasonBytes);
  return action;
}

zone::DeskAction ParseMove(const std::string& body) {
  constexpr char kAccepted[] = R"({"position": [LONGITUDE, LATITUDE], "reason": TEXT})";
  const Body json = ParseDeskBody(body, {"position", "reason"}, kAccepted);
  const auto position = json.find("position");
  const bool is_pair = position != json.end() && position->is_array() && position->size() == 2 &&
                       (*position)[0].is_number() && (*position)[1].is_number();
  zone::DeskAction action;
  action.kind = zone::DecisionKind::kMoveHazard;
  if (is_pair) action.position = {(*position)[1].get<double>(), (*position)[0].get<double>()};
  if (!is_pair || !geo::IsValid(action.position)) {
    throw BadRequest(std::string("the position is not accepted, accepted is ") + kAccepted +
                     " in degrees");
  }
  action.text = TextOf(json, "reason", kMaxDecisionReasonBytes);
  return action;
}

zone::DeskAction ParseMerge(const std::string& body) {
  const Body json = ParseDeskBody(body, {"other", "reason"}, R"({"other": UUID, "reason": TEXT})");
  constexpr std::size_t kUuidBytes = 36;
  const auto other = Uuid::Parse(NeededText(json, "other", kUuidBytes));
  if (!other) throw BadRequest("the other hazard's id is no UUID");
  zone::DeskAction action;
  action.kind = zone::DecisionKind::kMergeHazard;
  action.other = *other;
  action.text = TextOf(json, "reason", kMaxDecisionReasonBytes);
  return action;
}

zone::DeskAction ParseFrame(const std::string& body) {
  zone::DeskAction action;
  action.kind = zone::DecisionKind::kAskFrame;
  if (body.empty()) return action;
  const Body json = ParseDeskBody(body, {"reason"}, R"({"reason": TEXT})");
  action.text = TextOf(json, "reason", kMaxDecisionReasonBytes);
  return action;
}

bool IsLeapYear(int year) { return (year % 4 == 0 && year % 100 != 0) || year % 400 == 0; }

int DaysOf(int year, int month) {
  constexpr std::array<int, 12> kDays{31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  return month == 2 && IsLeapYear(year) ? 29 : kDays[static_cast<std::size_t>(month - 1)];
}

/// -1 for anything but digits.
int DigitsOf(std::string_view text) {
  int number = 0;
  for (const char digit : text) {
    if (digit < '0' || digit > '9') return -1;
    number = 10 * number + (digit - '0');
  }
  return number;
}

}  // namespace

std::optional<std::int64_t> ParseDay(const std::string& text) {
  if (text.size() != 10 || text[4] != '-' || text[7] != '-') return std::nullopt;
  const std::string_view all(text);
  const int year = DigitsOf(all.substr(0, 4));
  const int month = DigitsOf(all.substr(5, 2));
  const int day = DigitsOf(all.substr(8, 2));
  if (year < 1970 || year > 2105 || month < 1 || month > 12 || day < 1) return std::nullopt;
  if (day > DaysOf(year, month)) return std::nullopt;
  std::int64_t days = day - 1;
  for (int y = 1970; y < year; ++y) days += IsLeapYear(y) ? 366 : 365;
  for (int m = 1; m < month; ++m) days += DaysOf(year, m);
  return days * 86'400'000'000'000;
}

zone::DeskAction ParseDeskAction(Decision decision, const std::string& body) {
  switch (decision) {
    case Decision::kAssign:
      return ParseAssignment(body);
    case Decision::kClass:
      return ParseClass(body);
    case Decision::kMove:
      return ParseMove(body);
    case Decision::kMerge:
      return ParseMerge(body);
    case Decision::kFrame:
      return ParseFrame(body);
    default:
      return ParseComment(body);
  }
}

StatisticsQuery ParseStatisticsQuery(const RequestTarget& target) {
  StatisticsQuery query;
  for (const auto& [name, value] : target.parameters) {
    if (name != "weeks") {
      throw BadRequest("the address has an unknown parameter, accepted is weeks");
    }
    const int weeks = value.empty() || value.size() > 3 ? -1 : DigitsOf(value);
    if (weeks < 1 || weeks > static_cast<int>(kMaxWeeks)) {
      throw BadRequest("the weeks are not accepted, accepted is a whole number from 1 to " +
                       std::to_string(kMaxWeeks));
    }
    query.weeks = static_cast<std::size_t>(weeks);
  }
  return query;
}

}  // namespace livemap::web
