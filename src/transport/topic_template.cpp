#include "transport/topic_template.h"

#include <algorithm>

#include "common/error.h"

namespace livemap::transport {
namespace {

constexpr std::size_t kMaxIdBytes = 64;
constexpr std::size_t kMaxTemplateBytes = 1024;
constexpr std::string_view kZone = "{zone}";
constexpr std::string_view kVehicle = "{vehicle}";
constexpr std::string_view kCell = "{cell}";

bool IsTopicIdCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '_' || c == '-';
}

bool IsPlainTopicLevel(std::string_view level) {
  return !level.empty() && std::all_of(level.begin(), level.end(), IsTopicIdCharacter);
}

std::vector<std::string> SplitTopicLevels(std::string_view topic) {
  std::vector<std::string> levels(1);
  for (const char c : topic) {
    if (c == '/') {
      levels.emplace_back();
    } else {
      levels.back().push_back(c);
    }
  }
  return levels;
}

const std::string& RequireTopicId(const std::string& id, const std::string& what,
                                  const std::string& topic) {
  if (!IsValidId(id)) {
    throw Error(what + " '" + id + "' cannot stand in MQTT topic '" + topic +
                "', accepted are 1 to 64 characters of A-Z a-z 0-9 . _ -");
  }
  return id;
}

}  // namespace

bool IsValidId(std::string_view id) {
  return IsPlainTopicLevel(id) && id.size() <= kMaxIdBytes && id != "." && id != "..";
}

TopicTemplate::TopicTemplate(const std::string& text) : text_(text) {
  if (text.empty() || text.size() > kMaxTemplateBytes) {
    throw Error("MQTT topic template '" + text.substr(0, kMaxIdBytes) + "' has " +
                std::to_string(text.size()) + " bytes, accepted are 1 to " +
                std::to_string(kMaxTemplateBytes));
  }
  levels_ = SplitTopicLevels(text);
  const auto wrong = std::find_if(levels_.begin(), levels_.end(), [](const std::string& level) {
    return level != kZone && level != kVehicle && level != kCell && !IsPlainTopicLevel(level);
  });
  if (wrong != levels_.end()) {
    throw Error("MQTT topic template '" + text + "' has the level '" + *wrong +
                "', accepted are {zone}, {vehicle}, {cell} and characters of A-Z a-z 0-9 . _ -");
  }
  for (const std::string_view placeholder : {kZone, kVehicle, kCell}) {
    if (std::count(levels_.begin(), levels_.end(), placeholder) > 1) {
      throw Error("MQTT topic template '" + text + "' has " + std::string(placeholder) +
                  " more than once");
    }
  }
  has_zone_ = std::count(levels_.begin(), levels_.end(), kZone) == 1;
  has_vehicle_ = std::count(levels_.begin(), levels_.end(), kVehicle) == 1;
  has_cell_ = std::count(levels_.begin(), levels_.end(), kCell) == 1;
}

std::string TopicTemplate::Expand(const TopicNames& names) const {
  return Fill(names, false, false);
}

std::string TopicTemplate::SubscriptionFilter(const TopicNames& names) const {
  return Fill(names, names.vehicle.empty(), names.cell.empty());
}

std::string TopicTemplate::Fill(const TopicNames& names, bool any_vehicle, bool any_cell) const {
  std::string topic;
  for (const std::string& level : levels_) {
    if (!topic.empty()) topic += '/';
    if (level == kZone) {
      topic += RequireTopicId(names.zone, "zone", text_);
    } else if (level == kVehicle) {
      topic += any_vehicle ? "+" : RequireTopicId(names.vehicle, "vehicle", text_);
    } else if (level == kCell) {
      topic += any_cell ? "+" : RequireTopicId(names.cell, "cell", text_);
    } else {
      topic += level;
    }
  }
  return topic;
}

std::optional<TopicNames> TopicTemplate::Match(std::string_view topic) const {
  // The longest topic that can match is every placeholder filled to its limit.
  if (topic.size() > kMaxTemplateBytes + 3 * kMaxIdBytes) return std::nullopt;
  const std::vector<std::string> levels = SplitTopicLevels(topic);
  if (levels.size() != levels_.size()) return std::nullopt;
  TopicNames names;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (levels_[i] == kZone || levels_[i] == kVehicle || levels_[i] == kCell) {
      if (!IsValidId(levels[i])) return std::nullopt;
      std::string& name = levels_[i] == kZone      ? names.zone
                          : levels_[i] == kVehicle ? names.vehicle
                                                   : names.cell;
      name = levels[i];
    } else if (levels[i] != levels_[i]) {
      return std::nullopt;
    }
  }
  return names;
}

}  // namespace livemap::transport
