#include "web/ogc/street_counts.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/utc_text.h"
#include "streets/street_place.h"
#include "zone/model/hazard_spot.h"

namespace livemap::web {
namespace {

Json StreetPosition(const geo::GeoPoint& place) {
  return Json::array({Rounded(place.longitude_deg, 7), Rounded(place.latitude_deg, 7)});
}

}  // namespace

void StreetCounts::Add(const zone::Hazard& hazard) {
  const auto carriageway = streets::FindCarriageway(map_, zone::SpotOf(hazard));
  if (!carriageway) return;
  const std::uint32_t segment = carriageway->travel.segment;
  const std::int64_t id = map_.StreetOf(segment).id;
  if (id <= 0) return;
  const auto [entry, is_new] = ways_.try_emplace(static_cast<std::uint64_t>(id));
  Counted& counted = entry->second;
  if (is_new) counted = {segment, {}, hazard.first_seen_ns, hazard.last_seen_ns};
  ++counted.by_class[hazard.class_name];
  counted.first_ns = std::min(counted.first_ns, hazard.first_seen_ns);
  counted.last_ns = std::max(counted.last_ns, hazard.last_seen_ns);
}

Json StreetCounts::Lines(std::uint32_t segment) const {
  const std::uint32_t street = map_.SegmentAt(segment).street;
  const auto is_of_street = [&](std::uint32_t number) {
    return map_.SegmentAt(number).street == street;
  };
  std::uint32_t first = segment;
  while (first > 0 && is_of_street(first - 1)) --first;
  Json lines = Json::array();
  std::uint32_t end_node = 0;
  for (std::uint32_t i = first; i < map_.segments() && is_of_street(i); ++i) {
    const auto& at = map_.SegmentAt(i);
    if (lines.empty() || at.from != end_node) {
      lines.push_back(Json::array({StreetPosition(map_.PlaceOf(at.from))}));
    }
    lines.back().push_back(StreetPosition(map_.PlaceOf(at.to)));
    end_node = at.to;
  }
  return lines;
}

/// By the box around the lines.
bool StreetCounts::Touches(const Json& lines, const geo::GeoBox& box) const {
  geo::GeoBox around{{90, 180}, {-90, -180}};
  for (const Json& line : lines) {
    for (const Json& position : line) {
      const double longitude = position[0];
      const double latitude = position[1];
      auto& [south_west, north_east] = around;
      south_west = {std::min(south_west.latitude_deg, latitude),
                    std::min(south_west.longitude_deg, longitude)};
      north_east = {std::max(north_east.latitude_deg, latitude),
                    std::max(north_east.longitude_deg, longitude)};
    }
  }
  const bool meets_in_latitude = around.south_west.latitude_deg <= box.north_east.latitude_deg &&
                                 around.north_east.latitude_deg >= box.south_west.latitude_deg;
  const bool is_west_of = around.south_west.longitude_deg <= box.north_east.longitude_deg;
  const bool is_east_of = around.north_east.longitude_deg >= box.south_west.longitude_deg;
  const bool crosses = box.south_west.longitude_deg > box.north_east.longitude_deg;
  return meets_in_latitude && (crosses ? is_west_of || is_east_of : is_west_of && is_east_of);
}

Json StreetCounts::Feature(std::uint64_t id, const Counted& counted) const {
  const streets::Street& street = map_.StreetOf(counted.segment);
  const std::string& name = map_.NameOf(street);
  Json lines = Lines(counted.segment);
  Json feature;
  feature["type"] = "Feature";
  feature["id"] = id;
  if (lines.size() == 1) {
    feature["geometry"] = {{"type", "LineString"}, {"coordinates", std::move(lines[0])}};
  } else {
    feature["geometry"] = {{"type", "MultiLineString"}, {"coordinates", std::move(lines)}};
  }
  Json& properties = feature["properties"];
  properties["way"] = id;
  properties["name"] = name.empty() ? Json(nullptr) : Json(name);
  std::size_t count = 0;
  Json& by_class = properties["by_class"] = Json::object();
  for (const auto& [class_name, number] : counted.by_class) {
    by_class[class_name] = number;
    count += number;
  }
  properties["hazards"] = count;
  properties["first_seen"] = Rfc3339(counted.first_ns);
  properties["last_seen"] = Rfc3339(counted.last_ns);
  return feature;
}

Json StreetCounts::Next(const OgcQuery& query, std::uint64_t after, std::uint64_t& id) const {
  for (auto way = ways_.upper_bound(after); way != ways_.end(); ++way) {
    const Counted& counted = way->second;
    if (query.time && !query.time->Meets(counted.first_ns, counted.last_ns)) continue;
    if (query.box && !Touches(Lines(counted.segment), *query.box)) continue;
    id = way->first;
    return Feature(id, counted);
  }
  return nullptr;
}

std::optional<geo::GeoBox> StreetCounts::ReachOf(std::uint64_t id) const {
  // More than the 60 m within which a place is said to lie on a street.
  constexpr double kReachDeg = 0.001;
  std::optional<geo::GeoBox> reach;
  const auto include = [&](const geo::GeoPoint& place) {
    const double reach_east_deg = kReachDeg / std::cos(place.latitude_deg * geo::kRadiansPerDegree);
    if (!reach) reach = {place, place};
    auto& [south_west, north_east] = *reach;
    south_west = {std::min(south_west.latitude_deg, place.latitude_deg - kReachDeg),
                  std::min(south_west.longitude_deg, place.longitude_deg - reach_east_deg)};
    north_east = {std::max(north_east.latitude_deg, place.latitude_deg + kReachDeg),
                  std::max(north_east.longitude_deg, place.longitude_deg + reach_east_deg)};
  };
  for (std::uint32_t i = 0; i < map_.segments(); ++i) {
    if (static_cast<std::uint64_t>(map_.StreetOf(i).id) != id) continue;
    include(map_.PlaceOf(map_.SegmentAt(i).from));
    include(map_.PlaceOf(map_.SegmentAt(i).to));
  }
  return reach;
}

Json StreetCounts::Find(std::uint64_t id) const {
  const auto way = ways_.find(id);
  return way == ways_.end() ? Json(nullptr) : Feature(id, way->second);
}

}  // namespace livemap::web
