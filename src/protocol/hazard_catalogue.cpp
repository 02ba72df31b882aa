#include "protocol/hazard_catalogue.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "common/error.h"
#include "common/text_file.h"
#include "protocol/text_rules.h"

namespace livemap::protocol {
namespace {

constexpr std::size_t kMaxFileBytes = 1 << 20;

// What texts may be, checked by hand: GCC 12 warns of std::regex's own code under sanitizers.
struct TextRule {
  std::size_t min_size;
  std::size_t max_size;
  const char* characters;  // The allowed ones, or the forbidden ones.
  bool allowed;
  const char* accepted;  // In words.
};
constexpr TextRule kName{1, 40, "abcdefghijklmnopqrstuvwxyz0123456789_", true,
                         "1 to 40 of a-z, 0-9 and _"};
constexpr TextRule kLabel{1, 60, "<>&\"\n", false, "1 to 60 characters without < > & \""};
constexpr TextRule kHexColour{7, 7, "#0123456789abcdef", true, "#rrggbb in lower case"};
constexpr TextRule kUrgency{1, 1, "123", true, "1, 2 or 3"};
constexpr TextRule kConfirmations{1, 1, "12345", true, "1, 2, 3, 4 or 5"};

bool ObeysCatalogueRule(const std::string& text, const TextRule& rule) {
  if (text.size() < rule.min_size || text.size() > rule.max_size) return false;
  const auto odd =
      rule.allowed ? text.find_first_not_of(rule.characters) : text.find_first_of(rule.characters);
  return odd == std::string::npos && (text.find('#', 1) == std::string::npos || !rule.allowed) &&
         (rule.characters[0] != '#' || text[0] == '#');
}

/// Reads the scalars of one YAML map; its errors name source, place and key.
class HazardCatalogueReader {
 public:
  HazardCatalogueReader(const YAML::Node& node, std::string place)
      : node_(node), place_(std::move(place)) {
    if (!node_.IsMap()) throw Error(place_ + " must be a map of properties");
  }

  void ReadText(const char* key, const TextRule& rule, std::string& value) {
    const std::string* text = Scalar(key);
    if (text == nullptr) return;
    if (!ObeysCatalogueRule(*text, rule)) Refuse(key, *text, rule.accepted);
    value = *text;
  }

  void ReadDigit(const char* key, const TextRule& rule, int& value) {
    std::string text = std::to_string(value);
    ReadText(key, rule, text);
    value = text[0] - '0';
  }

  void ReadNumber(const char* key, double min, double max, double& value) {
    const std::string* text = Scalar(key);
    if (text == nullptr) return;
    double number = std::nan("");
    // Written so that NaN and text that is no number are refused too.
    if (!YAML::convert<double>::decode(node_[key], number) || !(number >= min && number <= max)) {
      Refuse(key, *text, "a number from " + Shortest(min) + " to " + Shortest(max));
    }
    value = number;
  }

  void RejectUnknown() const {
    for (const auto& entry : node_) {
      const auto key = entry.first.as<std::string>("");
      if (known_.count(key) != 0) continue;
      RefuseKey(key);
    }
  }

 private:
  [[noreturn]] void RefuseKey(const std::string& key) const {
    std::string accepted;
    for (const std::string& name : known_)
      accepted.append(accepted.empty() ? "" : ", ").append(name);
    throw Error(place_ + " has the unknown key '" + key + "', accepted are: " + accepted);
  }

  static std::string Shortest(double number) {
    std::string text = std::to_string(number);
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
    return text;
  }

  const std::string* Scalar(const char* key) {
    known_.insert(key);
    const YAML::Node value = node_[key];
    if (!value.IsDefined()) return nullptr;
    if (!value.IsScalar()) throw Error(place_ + ": '" + key + "' must be a single value");
    return &value.Scalar();
  }

  [[noreturn]] void Refuse(const char* key, const std::string& value,
                           const std::string& accepted) const {
    throw Error(place_ + ": '" + key + "' is '" + value + "', accepted is " + accepted);
  }

  const YAML::Node node_;
  const std::string place_;
  std::set<std::string> known_;
};

void ReadHazardClassProperties(const YAML::Node& node, const std::string& place,
                               HazardClass& entry) {
  HazardCatalogueReader reader(node, place);
  reader.ReadText("label", kLabel, entry.label);
  reader.ReadText("icon", kName, entry.icon);
  reader.ReadText("colour", kHexColour, entry.colour);
  reader.ReadNumber("duplicate_radius_m", 0.1, 1000.0, entry.duplicate_radius_m);
  reader.ReadNumber("half_depth_m", 0.0, 20.0, entry.half_depth_m);
  reader.ReadDigit("urgency", kUrgency, entry.urgency);
  reader.ReadNumber("expected_life_s", 60.0, 1e10, entry.expected_life_s);
  reader.ReadDigit("confirmations", kConfirmations, entry.confirmations);
  reader.ReadNumber("hit_rate", 0.5, 0.99, entry.hit_rate);
  reader.ReadNumber("false_rate", 0.001, 0.4, entry.false_rate);
  reader.RejectUnknown();
}

void CheckCatalogueSection(const std::string& key, const std::string& source) {
  if (key == "defaults" || key == "classes") return;
  throw Error("hazard catalogue '" + source + "' has the unknown key '" + key +
              "', accepted are: classes, defaults");
}

HazardClass ReadHazardClass(const std::string& name, const YAML::Node& node,
                            const std::string& place, HazardClass entry) {
  if (!ObeysCatalogueRule(name, kName)) {
    throw Error(place + "class '" + name + "' must be 1 to 40 of a-z, 0-9 and _");
  }
  ReadHazardClassProperties(node, place + "class '" + name + "'", entry);
  return entry;
}

[[noreturn]] void RefuseHazardClassTwice(const std::string& name, const std::string& place) {
  throw Error(place + "class '" + name + "' stands there twice");
}

}  // namespace

HazardCatalogue HazardCatalogue::Load(const std::string& path) {
  return Parse(ReadTextFile(path, kMaxFileBytes), path);
}

HazardCatalogue HazardCatalogue::Parse(const std::string& yaml, const std::string& source) {
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    throw Error("hazard catalogue '" + source + "' is no YAML: " + error.what());
  }
  if (!root.IsMap()) throw Error("hazard catalogue '" + source + "' must be a map");
  for (const auto& entry : root) CheckCatalogueSection(entry.first.as<std::string>(""), source);
  HazardCatalogue catalogue;
  const std::string place = "hazard catalogue '" + source + "', ";
  if (root["defaults"])
    ReadHazardClassProperties(root["defaults"], place + "defaults", catalogue.defaults_);
  if (!root["classes"].IsDefined() || !root["classes"].IsMap()) {
    throw Error(place + "classes must be a map of class names");
  }
  for (const auto& node : root["classes"]) {
    const auto name = node.first.as<std::string>("");
    const HazardClass entry = ReadHazardClass(name, node.second, place, catalogue.Get(name));
    if (!catalogue.classes_.emplace(name, entry).second) RefuseHazardClassTwice(name, place);
  }
  return catalogue;
}

HazardClass HazardCatalogue::Get(const std::string& class_name) const {
  const auto found = classes_.find(class_name);
  if (found != classes_.end()) return found->second;
  HazardClass entry = defaults_;
  entry.name = class_name;
  entry.label = class_name == kOtherClass ? "Other" : class_name;
  return entry;
}

bool HazardCatalogue::Names(const std::string& class_name) const {
  return classes_.empty() || classes_.count(Trimmed(class_name)) != 0;
}

std::string HazardCatalogue::HeadingOf(const std::string& class_name) const {
  return Names(class_name) ? Trimmed(class_name) : kOtherClass;
}

double HazardCatalogue::DuplicateRadiusM(const std::string& class_name) const {
  const auto found = classes_.find(class_name);
  return (found != classes_.end() ? found->second : defaults_).duplicate_radius_m;
}

double HazardCatalogue::MaxDuplicateRadiusM() const {
  double radius_m = defaults_.duplicate_radius_m;
  for (const auto& entry : classes_) {
    radius_m = std::max(radius_m, entry.second.duplicate_radius_m);
  }
  return radius_m;
}

}  // namespace livemap::protocol
