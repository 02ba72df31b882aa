#include "web/feeds/formats/wzdx_feed.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <set>
#include <utility>

#include "common/utc_text.h"
#include "web/feeds/feed_text.h"
#include "web/json/json.h"

namespace livemap::web {
namespace {

constexpr const char* kWzdxSource = "livemap";
constexpr std::size_t kWorkDeviceKinds = 5;

/// "3 cones, 1 barrier".
std::string DevicesText(const WorkZones::Zone& zone) {
  constexpr std::array<const char*, kWorkDeviceKinds> kNames{"", "cone", "barrier", "sign",
                                                             "machine"};
  std::array<std::size_t, kWorkDeviceKinds> counts{};
  for (const auto& device : zone) ++counts[static_cast<std::size_t>(device.kind)];
  std::string text;
  for (std::size_t i = 1; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    text += (text.empty() ? "" : ", ") + std::to_string(counts[i]) + ' ' + kNames[i] +
            (counts[i] == 1 ? "" : "s");
  }
  return text;
}

const char* LocationMethod(const WorkZones::Zone& zone) {
  const auto has = [&](auto kind) {
    return std::any_of(zone.begin(), zone.end(),
                       [&](const auto& device) { return device.kind == kind; });
  };
  if (has(WorkDeviceKind::kChannel) || has(WorkDeviceKind::kBarrier)) {
    return "channel-device-method";
  }
  return has(WorkDeviceKind::kSign) ? "sign-method" : "other";
}

/// A crossing of it; a house is none.
std::string CrossStreet(const std::string& near) { return near.rfind("no. ", 0) == 0 ? "" : near; }

/// The direction of all whose direction is known.
std::string DirectionOf(const WorkZones& zones, const WorkZones::Zone& zone) {
  std::uint32_t direction = 0;
  for (const auto& device : zone) {
    if (device.direction == 0) continue;
    if (direction != 0 && direction != device.direction) return "unknown";
    direction = device.direction;
  }
  return direction == 0 ? "unknown" : zones.name(direction);
}

Json RoadNames(const WorkZones& zones, const WorkZones::Zone& zone) {
  std::set<std::uint32_t> named;
  Json names = Json::array();
  for (const auto& device : zone) {
    if (device.street != 0 && named.insert(device.street).second) {
      names.push_back(zones.name(device.street));
    }
  }
  // The schema wants at least one.
  if (names.empty()) names.push_back("unknown");
  return names;
}

struct ZoneTimes {
  const WorkZones::Device* first;  ///< The device that was seen first.
  std::int64_t updated_ns = 0;
  std::int64_t ends_ns = 0;
};

ZoneTimes TimesOf(const WorkZones::Zone& zone) {
  ZoneTimes times{&zone.front()};
  for (const auto& device : zone) {
    if (std::pair(device.first_seen_ns, device.id) <
        std::pair(times.first->first_seen_ns, times.first->id)) {
      times.first = &device;
    }
    times.updated_ns = std::max(times.updated_ns, device.updated_ns);
    times.ends_ns = std::max(times.ends_ns, device.ends_ns);
  }
  return times;
}

Json WorkZoneFeature(const WorkZones& zones, const WorkZones::Zone& zone) {
  const ZoneTimes times = TimesOf(zone);
  Json feature;
  feature["id"] = times.first->id.ToString();
  feature["type"] = "Feature";
  Json& properties = feature["properties"];
  properties["core_details"] = {{"event_type", "work-zone"},
                                {"data_source_id", kWzdxSource},
                                {"road_names", RoadNames(zones, zone)},
                                {"direction", DirectionOf(zones, zone)},
                                {"description", DevicesText(zone)},
                                {"creation_date", Rfc3339Seconds(times.first->first_seen_ns)},
                                {"update_date", Rfc3339Seconds(times.updated_ns)}};
  const std::string begins = CrossStreet(zones.name(zone.front().near));
  const std::string ends = CrossStreet(zones.name(zone.back().near));
  if (!begins.empty()) properties["beginning_cross_street"] = begins;
  if (!ends.empty()) properties["ending_cross_street"] = ends;
  properties["is_start_position_verified"] = false;
  properties["is_end_position_verified"] = false;
  properties["start_date"] = Rfc3339Seconds(times.first->first_seen_ns);
  properties["end_date"] = Rfc3339Seconds(times.ends_ns);
  properties["is_start_date_verified"] = false;
  properties["is_end_date_verified"] = false;
  properties["location_method"] = LocationMethod(zone);
  // Nobody has looked at the lanes.
  properties["vehicle_impact"] = "unknown";
  Json& places = feature["geometry"] = {{"type", "MultiPoint"}, {"coordinates", Json::array()}};
  for (const auto& device : zone) {
    places["coordinates"].push_back(Json::array(
        {Rounded(device.position.longitude_deg, 7), Rounded(device.position.latitude_deg, 7)}));
  }
  return feature;
}

}  // namespace

void WzdxFeed::Begin(const FeedHead& head, std::string& text) {
  Json info;
  info["update_date"] = Rfc3339Seconds(head.now_ns);
  info["publisher"] = head.publisher;
  info["version"] = "4.2";
  info["data_sources"] =
      Json::array({{{"data_source_id", kWzdxSource}, {"organization_name", head.publisher}}});
  text += R"({"type":"FeatureCollection","feed_info":)" + ToText(info) + R"(,"features":[)";
}

void WzdxFeed::Add(const FeedHazard& hazard, std::string& /*text*/) { zones_.Add(hazard); }

bool WzdxFeed::End(std::string& text) {
  if (!is_closed_) zones_.Close();
  is_closed_ = true;
  constexpr int kZonesPerCall = 64;
  for (int i = 0; i < kZonesPerCall; ++i) {
    const WorkZones::Zone zone = zones_.Next();
    if (zone.empty()) {
      text += "]}\n";
      return false;
    }
    if (has_items_) text += ',';
    has_items_ = true;
    text += ToText(WorkZoneFeature(zones_, zone));
  }
  return true;
}

}  // namespace livemap::web
