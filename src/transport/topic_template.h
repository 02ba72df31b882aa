#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace livemap::transport {

/// True for 1 to 64 characters of [A-Za-z0-9._-] other than "." and "..": what may stand as a zone
/// or vehicle id in an MQTT topic, as a user of the broker, and as a file name.
bool IsValidId(std::string_view id);

/// The names that fill a topic template.
struct TopicNames {
  std::string zone;
  std::string vehicle;
  std::string cell = {};
};

/// An MQTT topic with the placeholders {zone}, {vehicle} and {cell}, each a whole level and at most
/// once: "livemap/v1/{zone}/vehicle/{vehicle}/report".
class TopicTemplate {
 public:
  /// Throws Error for an empty or over-long text, wildcards, control characters, and unknown or
  /// repeated placeholders.
  explicit TopicTemplate(const std::string& text);

  const std::string& text() const { return text_; }
  bool has_zone() const { return has_zone_; }
  bool has_vehicle() const { return has_vehicle_; }
  bool has_cell() const { return has_cell_; }

  /// The topic to publish on. Throws Error when a name that the template needs is no valid id.
  std::string Expand(const TopicNames& names) const;

  /// The filter to subscribe with: an empty `names.vehicle` stands for every vehicle ("+"),
  /// and so does an empty `names.cell` for every cell.
  /// Throws Error when a name is no valid id.
  std::string SubscriptionFilter(const TopicNames& names) const;

  /// The names that stand in a received topic; nullopt when the topic is not of this template or
  /// when a name is no valid id. A name without a placeholder comes back empty.
  std::optional<TopicNames> Match(std::string_view topic) const;

 private:
  std::string Fill(const TopicNames& names, bool any_vehicle, bool any_cell) const;

  std::string text_;
  std::vector<std::string> levels_;
  bool has_zone_ = false;
  bool has_vehicle_ = false;
  bool has_cell_ = false;
};

}  // namespace livemap::transport
