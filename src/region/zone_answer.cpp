#include "region/zone_answer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <utility>

#include "common/error.h"
#include "common/time.h"
#include "common/utc_text.h"
#include "protocol/text_rules.h"

namespace livemap::region {
namespace {

using AnswerJson = nlohmann::json;

constexpr int kMaxAnswerDepth = 8;
constexpr std::size_t kMaxClassBytes = 64;
/// Of a street's name, or of the sentence why there is none.
constexpr std::size_t kMaxWordsBytes = 256;
constexpr double kMaxSigmaM = 1e6;
constexpr double kMaxAheadS = 86400;

[[noreturn]] void RefuseMember(const std::string& name, const std::string& accepted) {
  throw Error("'" + name + "' is not acceptable, accepted is " + accepted);
}

const AnswerJson& AnswerMember(const AnswerJson& object, const char* name) {
  if (!object.is_object()) RefuseMember(name, "a member of an object");
  const auto member = object.find(name);
  if (member == object.end()) throw Error("'" + std::string(name) + "' is missing");
  return *member;
}

std::uint64_t ReadWhole(const AnswerJson& object, const char* name, std::uint64_t most) {
  const AnswerJson& value = AnswerMember(object, name);
  if (!value.is_number_unsigned() || value.get<std::uint64_t>() > most) {
    RefuseMember(name, "a whole number from 0 to " + std::to_string(most));
  }
  return value.get<std::uint64_t>();
}

/// JSON has no NaN; 1e999 is refused by the parser.
double ReadShare(const AnswerJson& object, const char* name) {
  const AnswerJson& value = AnswerMember(object, name);
  const double share = value.is_number() ? value.get<double>() : -1;
  if (!(share >= 0 && share <= 1)) RefuseMember(name, "a number from 0 to 1");
  return share;
}

Uuid ReadUuid(const AnswerJson& object, const char* name) {
  const AnswerJson& value = AnswerMember(object, name);
  const auto uuid = value.is_string() ? Uuid::Parse(value.get<std::string>()) : std::nullopt;
  if (!uuid || uuid->IsNil()) RefuseMember(name, "a UUID");
  return *uuid;
}

std::string ReadText(const AnswerJson& object, const char* name) {
  const AnswerJson& value = AnswerMember(object, name);
  if (!value.is_string()) RefuseMember(name, "a text");
  return value.get<std::string>();
}

/// Empty where there are none, and where they are no text that people could read: a street's name
/// is no reason to leave a hazard out.
std::string ReadWords(const AnswerJson& object, const char* name) {
  const auto value = object.find(name);
  if (value == object.end() || !value->is_string()) return "";
  std::string text = value->get<std::string>();
  return protocol::IsAcceptableText(text, kMaxWordsBytes) ? text : "";
}

/// "2026-01-31T12:00:00.250Z", as Rfc3339 writes it.
std::int64_t ReadStamp(const AnswerJson& object, const char* name, std::int64_t now_ns) {
  constexpr std::size_t kSecondsBytes = 19;
  const std::string text = ReadText(object, name);
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const bool has_form = text.size() == kSecondsBytes + 5 && text[kSecondsBytes] == '.' &&
                        text.back() == 'Z' &&
                        std::all_of(text.begin() + kSecondsBytes + 1, text.end() - 1, is_digit);
  const auto second_ns =
      has_form ? ParseRfc3339Seconds(text.substr(0, kSecondsBytes) + 'Z') : std::nullopt;
  if (!second_ns || *second_ns > now_ns + Nanoseconds(kMaxAheadS)) {
    RefuseMember(name, "a time from 1970 to a day from now, such as 2026-01-31T12:00:00.250Z");
  }
  std::int64_t milliseconds = 0;
  for (const char digit : text.substr(kSecondsBytes + 1, 3)) {
    milliseconds = 10 * milliseconds + (digit - '0');
  }
  return *second_ns + milliseconds * 1'000'000;
}

zone::HazardState ReadHazardState(const AnswerJson& object) {
  const std::string name = ReadText(object, "state");
  for (std::size_t i = 0; i < zone::kHazardStates; ++i) {
    const auto state = static_cast<zone::HazardState>(i);
    if (name == zone::HazardStateName(state)) return state;
  }
  RefuseMember("state", "candidate, active, verifying, gone or rejected");
}

geo::GeoPoint ReadPlace(const AnswerJson& feature) {
  const AnswerJson& place = AnswerMember(AnswerMember(feature, "geometry"), "coordinates");
  geo::GeoPoint point{std::numeric_limits<double>::quiet_NaN(), 0};
  if (place.is_array() && place.size() == 2 && place[0].is_number() && place[1].is_number()) {
    point = {place[1].get<double>(), place[0].get<double>()};
  }
  if (!geo::IsValid(point)) RefuseMember("coordinates", "a longitude and a latitude in degrees");
  return point;
}

/// Metres; 0 where it is not told.
double ReadSigma(const AnswerJson& object) {
  const AnswerJson& value = AnswerMember(object, "position_sigma_m");
  if (value.is_null()) return 0;
  const double sigma_m = value.is_number() ? value.get<double>() : -1;
  if (!(sigma_m >= 0 && sigma_m <= kMaxSigmaM)) {
    RefuseMember("position_sigma_m", "null or a number from 0 to 1e6");
  }
  return sigma_m;
}

ToldHazard ReadToldHazard(const AnswerJson& feature, std::int64_t now_ns) {
  constexpr std::uint64_t kMaxCount = std::numeric_limits<std::uint32_t>::max();
  const AnswerJson& properties = AnswerMember(feature, "properties");
  ToldHazard told;
  zone::Hazard& hazard = told.hazard;
  hazard.uuid = ReadUuid(properties, "id");
  hazard.class_name = ReadText(properties, "class");
  if (!protocol::IsAcceptableName(hazard.class_name, kMaxClassBytes)) {
    RefuseMember("class", "a printable name of at most " + std::to_string(kMaxClassBytes) +
                              " bytes without blanks at its ends");
  }
  hazard.position = ReadPlace(feature);
  const double sigma_m = ReadSigma(properties);
  hazard.covariance_m2 = sigma_m * sigma_m * Eigen::Matrix2d::Identity();
  hazard.confidence = static_cast<float>(ReadShare(properties, "confidence"));
  hazard.presence = static_cast<float>(ReadShare(properties, "presence"));
  hazard.sightings = static_cast<std::uint32_t>(ReadWhole(properties, "sightings", kMaxCount));
  hazard.vehicles = static_cast<std::uint32_t>(ReadWhole(properties, "vehicles", kMaxCount));
  hazard.state = ReadHazardState(properties);
  hazard.first_seen_ns = ReadStamp(properties, "first_seen", now_ns);
  hazard.last_seen_ns = ReadStamp(properties, "last_seen", now_ns);
  hazard.updated_ns = ReadStamp(properties, "updated", now_ns);
  hazard.sequence = ReadWhole(properties, "sequence", kMaxZoneSequence);
  told.words = {ReadWords(properties, "street"), ReadWords(properties, "near"),
                ReadWords(properties, "direction"), ReadWords(properties, "street_note")};
  return told;
}

}  // namespace

nlohmann::json ParseAnswerJson(const std::string& text) {
  if (text.size() > kMaxAnswerBytes) {
    throw Error("the answer has " + std::to_string(text.size()) + " bytes, accepted are at most " +
                std::to_string(kMaxAnswerBytes));
  }
  // Refused as it is read: what copies or destroys a value goes as deep as it does.
  const auto check_depth = [](int depth, AnswerJson::parse_event_t, const AnswerJson&) {
    if (depth <= kMaxAnswerDepth) return true;
    throw Error("the answer nests values more than " + std::to_string(kMaxAnswerDepth) +
                " deep, no zone's does");
  };
  try {
    return AnswerJson::parse(text, check_depth);
  } catch (const AnswerJson::parse_error& error) {
    throw Error("the answer is no JSON: it is wrong at byte " + std::to_string(error.byte));
  } catch (const AnswerJson::out_of_range&) {
    throw Error("the answer has a number that is too large for JSON");
  }
}

ToldHazard ParseToldHazard(const std::string& text, std::int64_t now_ns) {
  return ReadToldHazard(ParseAnswerJson(text), now_ns);
}

ZoneAnswer ParseZoneAnswer(const std::string& text, std::uint64_t after, std::int64_t now_ns) {
  const AnswerJson root = ParseAnswerJson(text);
  ZoneAnswer answer;
  answer.log = ReadUuid(root, "log");
  answer.sequence = ReadWhole(root, "sequence", kMaxZoneSequence);
  const AnswerJson& is_truncated = AnswerMember(root, "truncated");
  if (!is_truncated.is_boolean()) RefuseMember("truncated", "true or false");
  answer.is_truncated = is_truncated.get<bool>();
  // Else whoever follows would ask the same for ever.
  if (answer.is_truncated && answer.sequence <= after) {
    RefuseMember("sequence", "a number above " + std::to_string(after) + ", because there is more");
  }
  const AnswerJson& features = AnswerMember(root, "features");
  if (!features.is_array() || features.size() > kHazardsPerAnswer) {
    RefuseMember("features", "a list of at most " + std::to_string(kHazardsPerAnswer) + " hazards");
  }
  answer.hazards.reserve(features.size());
  for (const AnswerJson& feature : features) {
    try {
      answer.hazards.push_back(ReadToldHazard(feature, now_ns));
    } catch (const Error& error) {
      if (answer.refused++ == 0) answer.refusal = std::string("a hazard's ") + error.what();
    }
  }
  return answer;
}

}  // namespace livemap::region
