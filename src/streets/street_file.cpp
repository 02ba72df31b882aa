#include "streets/street_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <optional>
#include <osmium/osm/node.hpp>
#include <osmium/osm/relation.hpp>
#include <osmium/osm/way.hpp>
#include <vector>

#include "common/error.h"
#include "streets/osm_objects.h"

namespace livemap::streets {
namespace {

constexpr std::uintmax_t kMaxPbfBytes = 8'000'000'000;
constexpr std::uintmax_t kMaxXmlBytes = 2'000'000'000;  // One object may be all of it.
constexpr std::size_t kMaxWayNodes = 50'000;            // OpenStreetMap itself accepts 2000.
constexpr double kMaxWidthM = 60;
constexpr double kMaxLanes = 16;
constexpr double kMaxLayer = 20;

constexpr const char* kAccepted =
    "accepted are extracts of OpenStreetMap in PBF (.osm.pbf) or XML (.osm) with drivable streets";

struct KindName {
  const char* name;
  StreetKind kind;
};

constexpr std::array<KindName, 9> kKinds{{{"motorway", StreetKind::kMotorway},
                                          {"trunk", StreetKind::kTrunk},
                                          {"primary", StreetKind::kPrimary},
                                          {"secondary", StreetKind::kSecondary},
                                          {"tertiary", StreetKind::kTertiary},
                                          {"unclassified", StreetKind::kResidential},
                                          {"residential", StreetKind::kResidential},
                                          {"living_street", StreetKind::kService},
                                          {"service", StreetKind::kService}}};

/// The number with which a tag's value begins, where it lies within both.
std::optional<double> NumberOf(const char* value, double least, double most) {
  if (value == nullptr) return std::nullopt;
  char* end = nullptr;
  const double number = std::strtod(value, &end);
  if (end == value || !(number >= least && number <= most)) return std::nullopt;
  return number;
}

bool IsAny(const std::string& value, std::initializer_list<const char*> accepted) {
  return std::find(accepted.begin(), accepted.end(), value) != accepted.end();
}

bool SetKind(std::string highway, Street& street) {
  const std::string ending = "_link";
  if (highway.size() > ending.size() &&
      highway.compare(highway.size() - ending.size(), ending.size(), ending) == 0) {
    street.link = true;
    highway.resize(highway.size() - ending.size());
  }
  const auto* const found = std::find_if(
      kKinds.begin(), kKinds.end(), [&](const KindName& each) { return highway == each.name; });
  if (found == kKinds.end()) return false;
  street.kind = found->kind;
  return true;
}

void SetDirections(const osmium::TagList& tags, Street& street) {
  const bool implied = street.roundabout || street.kind == StreetKind::kMotorway;
  const std::string one_way = tags.get_value_by_key("oneway", implied ? "yes" : "no");
  if (IsAny(one_way, {"yes", "true", "1"})) street.backward = false;
  if (IsAny(one_way, {"-1", "reverse"})) street.forward = false;
}

/// Nothing where it cannot be driven.
std::optional<Street> StreetOf(const osmium::Way& way) {
  const osmium::TagList& tags = way.tags();
  const char* const highway = tags.get_value_by_key("highway");
  Street street;
  if (highway == nullptr || !SetKind(highway, street)) return std::nullopt;
  const std::string access = tags.get_value_by_key("access", "yes");
  const std::string motor =
      tags.get_value_by_key("motor_vehicle", tags.get_value_by_key("vehicle", access.c_str()));
  if (motor == "no" || tags.has_tag("area", "yes")) return std::nullopt;
  street.id = way.id();
  street.roundabout = IsAny(tags.get_value_by_key("junction", ""), {"roundabout", "circular"});
  street.bridge = IsAny(tags.get_value_by_key("bridge", "no"), {"yes", "viaduct", "movable"});
  street.tunnel = IsAny(tags.get_value_by_key("tunnel", "no"), {"yes", "building_passage"});
  SetDirections(tags, street);
  const int level = street.bridge ? 1 : street.tunnel ? -1 : 0;
  street.layer = static_cast<std::int8_t>(
      NumberOf(tags.get_value_by_key("layer"), -kMaxLayer, kMaxLayer).value_or(level));
  street.lanes =
      static_cast<std::uint8_t>(NumberOf(tags.get_value_by_key("lanes"), 1, kMaxLanes).value_or(0));
  street.width_m =
      static_cast<float>(NumberOf(tags.get_value_by_key("width"), 1, kMaxWidthM).value_or(0));
  return street;
}

void TakeWay(const osmium::Way& way, std::vector<std::int64_t>& nodes, StreetMapBuilder& builder) {
  if (way.nodes().size() < 2) return;
  const std::optional<Street> street = StreetOf(way);
  if (!street) return;
  if (way.nodes().size() > kMaxWayNodes) {
    throw Error("way " + std::to_string(way.id()) + " has " + std::to_string(way.nodes().size()) +
                " nodes, accepted are at most " + std::to_string(kMaxWayNodes));
  }
  nodes.clear();
  for (const osmium::NodeRef& node : way.nodes()) nodes.push_back(node.ref());
  // Motorways and country roads often have a number alone.
  const char* const number = way.tags().get_value_by_key("ref", "");
  builder.AddStreet(*street, way.tags().get_value_by_key("name", number), nodes);
}

/// Nothing where it is none of turns at a node, or not of cars at all times.
std::optional<TurnRestriction> RestrictionOf(const osmium::Relation& relation) {
  const osmium::TagList& tags = relation.tags();
  const std::string rule =
      tags.get_value_by_key("restriction:motorcar", tags.get_value_by_key("restriction", ""));
  const bool only = rule.compare(0, 5, "only_") == 0;
  if (!tags.has_tag("type", "restriction") || (!only && rule.compare(0, 3, "no_") != 0)) {
    return std::nullopt;
  }
  const std::string except = tags.get_value_by_key("except", "");
  if (except.find("motorcar") != std::string::npos ||
      except.find("motor_vehicle") != std::string::npos) {
    return std::nullopt;
  }
  TurnRestriction restriction;
  restriction.only = only;
  int members = 0;
  for (const osmium::RelationMember& member : relation.members()) {
    const std::string role = member.role();
    const bool is_way = member.type() == osmium::item_type::way;
    ++members;
    if (role == "from" && is_way) restriction.from = member.ref();
    if (role == "to" && is_way) restriction.to = member.ref();
    if (role == "via" && member.type() == osmium::item_type::node) restriction.via = member.ref();
  }
  // Of several ways, or by way of another street: it is not simple, and left out.
  const bool whole = restriction.from != 0 && restriction.via != 0 && restriction.to != 0;
  if (members != 3 || !whole) return std::nullopt;
  return restriction;
}

StreetMap ReadStreets(const osmium::io::File& file, const std::string& name,
                      const StreetLimits& limits) {
  try {
    StreetMapBuilder builder(limits);
    std::vector<std::int64_t> nodes;
    ForEachObject<osmium::Way>(file, osmium::osm_entity_bits::way,
                               [&](const osmium::Way& way) { TakeWay(way, nodes, builder); });
    ForEachObject<osmium::Relation>(
        file, osmium::osm_entity_bits::relation, [&](const osmium::Relation& relation) {
          const std::optional<TurnRestriction> restriction = RestrictionOf(relation);
          if (restriction) builder.AddRestriction(*restriction);
        });
    ForEachObject<osmium::Node>(file, osmium::osm_entity_bits::node, [&](const osmium::Node& node) {
      const osmium::Location location = node.location();
      if (location.valid()) builder.SetPlace(node.id(), {location.lat(), location.lon()});
    });
    StreetMap map = builder.Build();
    if (map.segments() > 0) return map;
    throw Error("it has no drivable street");
  } catch (const std::exception& error) {
    throw Error("the street file '" + name + "' is refused: " + error.what() + "; " + kAccepted);
  }
}

bool EndsWith(const std::string& text, const std::string& ending) {
  return text.size() > ending.size() &&
         text.compare(text.size() - ending.size(), ending.size(), ending) == 0;
}

}  // namespace

StreetMap ReadStreetFile(const std::string& path, const StreetLimits& limits) {
  const bool is_pbf = EndsWith(path, ".osm.pbf") || EndsWith(path, ".pbf");
  if (!is_pbf && !EndsWith(path, ".osm")) {
    throw Error("the street file '" + path + "' has another ending than .osm.pbf and .osm; " +
                kAccepted);
  }
  std::error_code error;
  // The library opens names such as http://... by another program; a file's full path is none.
  const std::filesystem::path full = std::filesystem::canonical(path, error);
  if (error || !std::filesystem::is_regular_file(full, error)) {
    throw Error("the street file '" + path + "' cannot be read: " +
                (error ? error.message() : "it is no file") + "; " + kAccepted);
  }
  const std::uintmax_t bytes = std::filesystem::file_size(full, error);
  const std::uintmax_t most = is_pbf ? kMaxPbfBytes : kMaxXmlBytes;
  if (error || bytes > most) {
    throw Error("the street file '" + path + "' has " + std::to_string(bytes) +
                " bytes, accepted are at most " + std::to_string(most));
  }
  return ReadStreets(osmium::io::File(full.string(), is_pbf ? "pbf" : "osm"), path, limits);
}

StreetMap ParseStreets(const std::string& bytes, const std::string& format, const std::string& name,
                       const StreetLimits& limits) {
  if (format != "pbf" && format != "osm") {
    throw Error("the format of streets is '" + format + "', accepted are pbf and osm");
  }
  return ReadStreets(osmium::io::File(bytes.data(), bytes.size(), format), name, limits);
}

}  // namespace livemap::streets
