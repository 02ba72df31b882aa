#include "directory/zone_directory.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>
#include <utility>

#include "common/error.h"
#include "common/utc_text.h"
#include "protocol/text_rules.h"
#include "transport/topic_template.h"

namespace livemap::directory {
namespace {

using Json = nlohmann::json;

constexpr std::uint64_t kFormat = 1;
constexpr std::size_t kMaxNameBytes = 64;
constexpr std::size_t kMaxHostBytes = 253;
constexpr std::size_t kMaxUrlBytes = 512;
constexpr std::size_t kMaxShownBytes = 60;
/// Numbers of JSON are exact up to here in every program that may read them (RFC 7493).
constexpr std::uint64_t kMaxVersion = (std::uint64_t{1} << 53) - 1;
/// Between the places that FindOverlaps looks at.
constexpr double kBorderStepM = 100;

/// A value as a message shows it.
std::string Shown(const Json& value) {
  if (value.is_object()) return "an object";
  if (value.is_array()) return "a list of " + std::to_string(value.size());
  const std::string text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
  return text.size() > kMaxShownBytes ? text.substr(0, kMaxShownBytes) + "..." : text;
}

/// Values that lie deeper than a MultiPolygon's coordinates do are refused as they are read: what
/// compares or copies them goes as deep as they do.
Json ParseShallow(const std::string& text, const std::string& name) {
  constexpr int kMaxDepth = 12;
  const auto check_depth = [&](int depth, Json::parse_event_t, const Json&) {
    if (depth > kMaxDepth) {
      throw Error("'" + name + "' nests values more than " + std::to_string(kMaxDepth) +
                  " deep, no zone directory does");
    }
    return true;
  };
  try {
    return Json::parse(text, check_depth);
  } catch (const Json::parse_error& error) {
    throw Error("'" + name + "' is no JSON: it is wrong at byte " + std::to_string(error.byte));
  } catch (const Json::out_of_range&) {
    throw Error("'" + name + "' has a number that is too large for JSON");
  }
}

/// Reads one directory; `place_` says in each error where in it.
class DirectoryReader {
 public:
  explicit DirectoryReader(std::string name) : place_("'" + std::move(name) + "': ") {}

  std::vector<ZoneEntry> ReadZones(const Json& root) {
    const Json& features = Member(root, "features");
    if (!features.is_array() || features.empty() || features.size() > ZoneDirectory::kMaxZones) {
      Refuse("'features' is " + Shown(features),
             "a list of 1 to " + std::to_string(ZoneDirectory::kMaxZones) + " zones");
    }
    std::vector<ZoneEntry> zones;
    std::set<std::string> ids;
    const std::string directory = place_;
    for (std::size_t i = 0; i < features.size(); ++i) {
      place_ = directory + "feature " + std::to_string(i) + ": ";
      zones.push_back(ReadZone(features[i]));
      if (!ids.insert(zones.back().id).second) {
        Refuse("the id '" + zones.back().id + "' is there twice", "an id of its own");
      }
    }
    place_ = directory;
    return zones;
  }

  std::string ReadId(const Json& json, const char* key) const {
    const Json& value = Member(json, key);
    if (!value.is_string() || !transport::IsValidId(value.get_ref<const std::string&>())) {
      Refuse("'" + std::string(key) + "' is " + Shown(value),
             "1 to 64 characters of A-Z a-z 0-9 . _ -");
    }
    return value.get<std::string>();
  }

  std::uint64_t ReadVersion(const Json& root) const {
    const Json& value = Member(root, "version");
    if (!value.is_number_unsigned() || value.get<std::uint64_t>() == 0 ||
        value.get<std::uint64_t>() > kMaxVersion) {
      Refuse("'version' is " + Shown(value), "a whole number from 1 to 2^53 - 1");
    }
    return value.get<std::uint64_t>();
  }

  std::int64_t ReadTime(const Json& root, const char* key) const {
    const Json& value = Member(root, key);
    const auto time_ns =
        value.is_string() ? ParseRfc3339Seconds(value.get_ref<const std::string&>()) : std::nullopt;
    if (!time_ns) {
      Refuse("'" + std::string(key) + "' is " + Shown(value), "a time as 2026-01-31T12:00:00Z");
    }
    return *time_ns;
  }

  void RequireText(const Json& json, const char* key, const char* text) const {
    const Json& value = Member(json, key);
    if (value != text) {
      Refuse("'" + std::string(key) + "' is " + Shown(value), "\"" + std::string(text) + "\"");
    }
  }

  void RequireFormat(const Json& root) const {
    const Json& value = Member(root, "livemap_zone_directory");
    if (value != kFormat) Refuse("'livemap_zone_directory' is " + Shown(value), "1");
  }

  const Json& Member(const Json& json, const char* key) const {
    if (!json.is_object()) Refuse("there is " + Shown(json), "an object");
    const auto member = json.find(key);
    if (member == json.end()) throw Error(place_ + "'" + key + "' is missing");
    return *member;
  }

  [[noreturn]] void Refuse(const std::string& what, const std::string& accepted) const {
    throw Error(place_ + what + ", accepted is " + accepted);
  }

 private:
  ZoneEntry ReadZone(const Json& feature) {
    RequireText(feature, "type", "Feature");
    const std::string id = ReadId(feature, "id");
    const Json& properties = Member(feature, "properties");
    return {id, ReadName(properties), ReadArea(Member(feature, "geometry")),
            ReadBrokers(properties), ReadMapUrl(properties)};
  }

  std::string ReadName(const Json& properties) const {
    if (!properties.is_object()) Refuse("'properties' is " + Shown(properties), "an object");
    const auto name = properties.find("name");
    if (name == properties.end() || name->is_null()) return "";
    if (!name->is_string() ||
        !protocol::IsAcceptableName(name->get_ref<const std::string&>(), kMaxNameBytes)) {
      Refuse("'name' is " + Shown(*name), "printable text of at most 64 bytes");
    }
    return name->get<std::string>();
  }

  ZoneArea ReadArea(const Json& geometry) {
    const Json& type = Member(geometry, "type");
    const Json& coordinates = Member(geometry, "coordinates");
    std::vector<ZoneArea::Ring> rings;
    if (type == "Polygon") {
      ReadPolygon(coordinates, rings);
    } else if (type == "MultiPolygon") {
      RequireList(coordinates, "'coordinates'");
      for (const Json& polygon : coordinates) ReadPolygon(polygon, rings);
    } else {
      Refuse("the geometry's 'type' is " + Shown(type), "Polygon or MultiPolygon");
    }
    try {
      return ZoneArea(std::move(rings));
    } catch (const Error& error) {
      throw Error(place_ + error.what());
    }
  }

  void ReadPolygon(const Json& coordinates, std::vector<ZoneArea::Ring>& rings) {
    RequireList(coordinates, "a polygon");
    for (const Json& ring : coordinates) rings.push_back(ReadRing(ring));
  }

  /// The ring without its last position, which is its first one again.
  ZoneArea::Ring ReadRing(const Json& positions) {
    RequireList(positions, "a ring");
    corners_ += positions.size();
    if (corners_ > ZoneDirectory::kMaxCorners) {
      Refuse("the zones up to here have more corners",
             "at most " + std::to_string(ZoneDirectory::kMaxCorners) + " of all");
    }
    if (positions.size() < 4 || positions.front() != positions.back()) {
      Refuse("a ring has " + std::to_string(positions.size()) + " positions",
             "4 or more, the last as the first (RFC 7946)");
    }
    ZoneArea::Ring ring;
    for (std::size_t i = 0; i + 1 < positions.size(); ++i) ring.push_back(ReadCorner(positions[i]));
    return ring;
  }

  geo::GeoPoint ReadCorner(const Json& position) const {
    const bool is_position = position.is_array() && (position.size() == 2 || position.size() == 3);
    if (!is_position || !position[0].is_number() || !position[1].is_number()) {
      Refuse("a corner is " + Shown(position), "[longitude, latitude]");
    }
    return {position[1].get<double>(), position[0].get<double>()};
  }

  void RequireList(const Json& list, const std::string& what) const {
    if (!list.is_array() || list.empty()) Refuse(what + " is " + Shown(list), "a list (RFC 7946)");
  }

  std::vector<BrokerAddress> ReadBrokers(const Json& properties) const {
    const Json& list = Member(properties, "brokers");
    if (!list.is_array() || list.empty() || list.size() > ZoneDirectory::kMaxBrokers) {
      Refuse("'brokers' is " + Shown(list),
             "a list of 1 to " + std::to_string(ZoneDirectory::kMaxBrokers) + " brokers");
    }
    std::vector<BrokerAddress> brokers;
    for (const Json& broker : list) {
      brokers.push_back({ReadHost(broker), ReadPort(broker), ReadFingerprint(broker)});
    }
    return brokers;
  }

  /// What it may hold goes into a line of a request.
  std::string ReadMapUrl(const Json& properties) const {
    constexpr std::string_view kUrlCharacters =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789.-_~:/[]";
    const auto value = properties.find("map");
    if (value == properties.end() || value->is_null()) return "";
    std::string url = value->is_string() ? value->get<std::string>() : "";
    const bool has_scheme = url.rfind("https://", 0) == 0 || url.rfind("http://", 0) == 0;
    if (!has_scheme || url.size() > kMaxUrlBytes ||
        url.find_first_not_of(kUrlCharacters) != std::string::npos) {
      Refuse("'map' is " + Shown(*value), "http(s)://HOST or http(s)://HOST/PATH");
    }
    return url;
  }

  std::string ReadHost(const Json& broker) const {
    constexpr std::string_view kHostCharacters =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789.-:";
    const Json& value = Member(broker, "host");
    std::string host = value.is_string() ? value.get<std::string>() : "";
    const bool is_host = !host.empty() && host.size() <= kMaxHostBytes && host.front() != '-' &&
                         host.find_first_not_of(kHostCharacters) == std::string::npos;
    if (!is_host) Refuse("'host' is " + Shown(value), "a host name or an IP address");
    return host;
  }

  int ReadPort(const Json& broker) const {
    const auto value = broker.find("port");
    if (value == broker.end()) return BrokerAddress{}.port;
    if (!value->is_number_unsigned() || *value < 1U || *value > 65535U) {
      Refuse("'port' is " + Shown(*value), "1 to 65535");
    }
    return value->get<int>();
  }

  std::string ReadFingerprint(const Json& broker) const {
    const auto value = broker.find("fingerprint");
    if (value == broker.end() || value->is_null()) return "";
    std::string text = value->is_string() ? value->get<std::string>() : "";
    if (text.size() != 64 || text.find_first_not_of("0123456789abcdef") != std::string::npos) {
      Refuse("'fingerprint' is " + Shown(*value), "64 hex digits in lower case (SHA-256)");
    }
    return text;
  }

  std::string place_;
  std::size_t corners_ = 0;
};

/// Calls `look` with places every kBorderStepM along the border, its corners among them.
template <typename Look>
void WalkBorder(const ZoneArea& area, const Look& look) {
  for (const ZoneArea::Ring& ring : area.rings()) {
    geo::GeoPoint from = ring.back();
    for (const geo::GeoPoint& to : ring) {
      const double length_m =
          geo::GeodesicDistanceM({from.latitude_deg, std::remainder(from.longitude_deg, 360.0)},
                                 {to.latitude_deg, std::remainder(to.longitude_deg, 360.0)});
      const int steps = std::max(1, static_cast<int>(std::ceil(length_m / kBorderStepM)));
      for (int step = 1; step <= steps; ++step) {
        const double share = static_cast<double>(step) / steps;
        look(geo::GeoPoint{
            from.latitude_deg + share * (to.latitude_deg - from.latitude_deg),
            std::remainder(from.longitude_deg + share * (to.longitude_deg - from.longitude_deg),
                           360.0)});
      }
      from = to;
    }
  }
}

}  // namespace

ZoneDirectory ZoneDirectory::Parse(const std::string& geojson, const std::string& name) {
  if (geojson.size() > kMaxBytes) {
    throw Error("'" + name + "' has " + std::to_string(geojson.size()) +
                " bytes, accepted are at most " + std::to_string(kMaxBytes));
  }
  const Json root = ParseShallow(geojson, name);
  DirectoryReader reader(name);
  ZoneDirectory directory;
  reader.RequireText(root, "type", "FeatureCollection");
  reader.RequireFormat(root);
  directory.authority_ = reader.ReadId(root, "authority");
  directory.version_ = reader.ReadVersion(root);
  directory.issued_ns_ = reader.ReadTime(root, "issued");
  directory.expires_ns_ = reader.ReadTime(root, "expires");
  if (directory.expires_ns_ <= directory.issued_ns_) {
    reader.Refuse("'expires' is " + Rfc3339Seconds(directory.expires_ns_),
                  "a time after it was issued, " + Rfc3339Seconds(directory.issued_ns_));
  }
  directory.zones_ = reader.ReadZones(root);
  return directory;
}

std::optional<ZoneDirectory::Found> ZoneDirectory::Find(const geo::GeoPoint& point,
                                                        double max_gap_m) const {
  std::optional<Found> best;
  for (std::size_t i = 0; i < zones_.size(); ++i) {
    if (!zones_[i].area.IsNear(point, max_gap_m)) continue;
    const double depth_m = zones_[i].area.DepthM(point);
    if (depth_m < -max_gap_m || (best && depth_m <= best->depth_m)) continue;
    best = Found{i, depth_m};
  }
  return best;
}

std::optional<std::size_t> ZoneDirectory::FindId(const std::string& id) const {
  for (std::size_t i = 0; i < zones_.size(); ++i) {
    if (zones_[i].id == id) return i;
  }
  return std::nullopt;
}

ZoneChoice::ZoneChoice(const Config& config) : config_(config) {
  // Written so that NaN is refused, too.
  const auto is_way = [](double way_m) { return way_m >= 0 && std::isfinite(way_m); };
  if (!is_way(config_.hysteresis_m) || !is_way(config_.max_gap_m)) {
    throw Error("the choice of a zone has a hysteresis of " + std::to_string(config_.hysteresis_m) +
                " m and a greatest gap of " + std::to_string(config_.max_gap_m) +
                " m, accepted are metres from 0");
  }
}

std::optional<std::size_t> ZoneChoice::Update(const ZoneDirectory& directory,
                                              const geo::GeoPoint& point) {
  auto found = directory.Find(point, config_.max_gap_m);
  const auto present = directory.FindId(present_);
  if (found && present && *present != found->zone) {
    const double depth_m = directory.zones()[*present].area.DepthM(point);
    if (depth_m >= found->depth_m - config_.hysteresis_m) found->zone = *present;
  }
  present_ = found ? directory.zones()[found->zone].id : "";
  if (!found) return std::nullopt;
  return found->zone;
}

std::vector<ZoneOverlap> FindOverlaps(const ZoneDirectory& directory, double max_depth_m) {
  std::vector<ZoneOverlap> overlaps;
  const std::vector<ZoneEntry>& zones = directory.zones();
  for (std::size_t first = 0; first < zones.size(); ++first) {
    for (std::size_t second = first + 1; second < zones.size(); ++second) {
      if (!zones[first].area.MayOverlap(zones[second].area)) continue;
      std::optional<ZoneOverlap> deepest;
      const auto look_from = [&](const ZoneArea& border, const ZoneArea& other) {
        WalkBorder(border, [&](const geo::GeoPoint& place) {
          if (!other.IsNear(place, 0)) return;
          const double depth_m = other.DepthM(place);
          if (depth_m <= max_depth_m || (deepest && depth_m <= deepest->depth_m)) return;
          deepest = ZoneOverlap{first, second, place, depth_m};
        });
      };
      look_from(zones[first].area, zones[second].area);
      look_from(zones[second].area, zones[first].area);
      if (deepest) overlaps.push_back(*deepest);
    }
  }
  return overlaps;
}

}  // namespace livemap::directory
