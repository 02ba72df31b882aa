#include "vehicle/speech/spoken_language.h"

#include <algorithm>
#include <cmath>
#include <regex>
#include <sstream>

#include "common/error.h"
#include "common/text_file.h"

namespace livemap::vehicle {
namespace {

constexpr std::size_t kMaxLanguageBytes = 1 << 20;
constexpr std::size_t kMaxSpokenBytes = 200;
constexpr char kHazard[] = "{hazard}";
constexpr char kDistance[] = "{distance}";
constexpr char kClassKey[] = "class ";
constexpr const char* kSentences[] = {"ahead", "left", "right", "near"};

bool IsSentence(const std::string& key) {
  return std::find(std::begin(kSentences), std::end(kSentences), key) != std::end(kSentences);
}

bool IsClass(const std::string& key) { return key.rfind(kClassKey, 0) == 0; }

std::string Trimmed(const std::string& text) {
  const auto begin = text.find_first_not_of(" \t");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// What is accepted instead of this text; empty where it is accepted.
std::string WrongText(const std::string& key, const std::string& text) {
  if (text.empty() || text.size() > kMaxSpokenBytes) {
    return "a text of 1 to " + std::to_string(kMaxSpokenBytes) + " bytes";
  }
  if (key == "language") {
    static const std::regex kCode("[A-Za-z]{2,8}(-[A-Za-z0-9]{1,8})*");
    return std::regex_match(text, kCode) ? "" : "a code such as en or pt-BR";
  }
  const bool has_hazard = text.find(kHazard) != std::string::npos;
  const bool has_distance = text.find(kDistance) != std::string::npos;
  std::string rest = Replaced(Replaced(text, kHazard, ""), kDistance, "");
  const bool has_more = rest.find_first_of("{}") != std::string::npos;
  if (!IsSentence(key)) return rest != text || has_more ? "a name without braces" : "";
  if (key == "near") {
    return has_hazard && !has_distance && !has_more ? "" : "a sentence with {hazard} once";
  }
  return has_hazard && has_distance && !has_more ? ""
                                                 : "a sentence with {hazard} and {distance} once";
}

/// One line that is no comment, as key and text.
std::pair<std::string, std::string> ReadLine(const std::string& line, const std::string& place) {
  const auto equals = line.find('=');
  if (equals == std::string::npos) {
    throw Error(place + " is '" + line + "', accepted is KEY = TEXT");
  }
  std::string key = Trimmed(line.substr(0, equals));
  std::string text = Trimmed(line.substr(equals + 1));
  if (key != "language" && !IsSentence(key) && !IsClass(key)) {
    throw Error(place + " has the key '" + key +
                "', accepted is language, ahead, left, right, near or class NAME");
  }
  const std::string accepted = WrongText(key, text);
  if (!accepted.empty()) {
    throw Error(place + ": '" + key + "' is '" + text + "', accepted is " + accepted);
  }
  return {std::move(key), std::move(text)};
}

}  // namespace

int SpokenDistanceM(double distance_m) {
  const int step_m = distance_m < 100 ? 10 : distance_m < 1000 ? 50 : 100;
  return static_cast<int>(std::lround(std::max(0.0, distance_m) / step_m)) * step_m;
}

SpokenLanguage SpokenLanguage::Load(const std::string& path,
                                    const protocol::HazardCatalogue& catalogue) {
  return Parse(ReadTextFile(path, kMaxLanguageBytes), path, catalogue);
}

SpokenLanguage SpokenLanguage::Parse(const std::string& text, const std::string& source,
                                     const protocol::HazardCatalogue& catalogue) {
  SpokenLanguage language;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    line = Trimmed(line);
    if (line.empty() || line.front() == '#') continue;
    const std::string place = source + ", line " + std::to_string(number);
    auto [key, value] = ReadLine(line, place);
    if (!language.texts_.emplace(key, std::move(value)).second) {
      throw Error(place + " has the key '" + key + "' again, accepted is each key once");
    }
  }
  std::vector<std::string> needed = {"language", "class other"};
  needed.insert(needed.end(), std::begin(kSentences), std::end(kSentences));
  for (const auto& entry : catalogue.classes()) needed.push_back(kClassKey + entry.first);
  for (const std::string& key : needed) {
    if (language.texts_.count(key) == 0) {
      throw Error(source + " has no line '" + key + " = TEXT', which is needed");
    }
  }
  return language;
}

std::string SpokenLanguage::SentenceOf(const HazardAlert& alert) const {
  const char* sentence = "ahead";
  if (alert.side == HazardAlert::Side::kLeft) sentence = "left";
  if (alert.side == HazardAlert::Side::kRight) sentence = "right";
  if (alert.distance_m < kNearM) sentence = "near";
  const auto named = texts_.find(kClassKey + alert.class_name);
  const std::string& name = named == texts_.end() ? texts_.at("class other") : named->second;
  return Replaced(
      Replaced(texts_.at(sentence), kDistance, std::to_string(SpokenDistanceM(alert.distance_m))),
      kHazard, name);
}

}  // namespace livemap::vehicle
