// Street files in XML and PBF, and what a vehicle and a zone ask of the streets that the reader
// accepts.
#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>

#include "common/error.h"
#include "streets/address_file.h"
#include "streets/street_file.h"
#include "streets/street_lines.h"
#include "streets/street_map.h"
#include "streets/street_matcher.h"
#include "streets/street_place.h"
#include "streets/ways_ahead.h"

namespace {

using livemap::streets::StreetMap;

void DriveAlong(const std::shared_ptr<const StreetMap>& map) {
  livemap::streets::StreetMatcher matcher(map, {});
  const auto segments = static_cast<std::uint32_t>(std::min<std::size_t>(map->segments(), 20));
  for (std::uint32_t segment = 0; segment < segments; ++segment) {
    livemap::streets::StreetMatcher::Position position;
    position.place = map->PlaceOf(map->SegmentAt(segment).to);
    position.sigma_m = 2;
    position.speed_mps = 10;
    position.course_rad = 0.5;
    if (!matcher.Add(position)) continue;
    const livemap::geo::LocalFrame frame(position.place);
    livemap::streets::Driving driving;
    driving.speed_mps = 10;
    driving.course_known = true;
    const livemap::streets::WaysAhead ways({}, *map, matcher.matches(), frame, driving, 300);
    if (ways.legs().size() > 600) __builtin_trap();
  }
}

/// Words of places and lines for a page.
void DescribeAndDraw(const StreetMap& map, const livemap::streets::AddressMap& houses) {
  const auto segments = static_cast<std::uint32_t>(std::min<std::size_t>(map.segments(), 20));
  for (std::uint32_t segment = 0; segment < segments; ++segment) {
    const livemap::streets::Spot spot{map.PlaceOf(map.SegmentAt(segment).from), 3, 0.5};
    const auto words = livemap::streets::DescribeSpot(map, spot, &houses);
    if (words.street.size() > 256 || words.near.size() > 260) __builtin_trap();
  }
  const livemap::streets::StreetLines lines(map);
  for (const int zoom : {0, 9, 14, 22}) {
    std::size_t points = 0;
    for (const auto& line : lines.Find(map.Bounds(), zoom, 2000).lines)
      points += line.points.size();
    if (points > 2000) __builtin_trap();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  livemap::streets::StreetLimits limits;
  limits.max_streets = 1000;
  limits.max_nodes = 10'000;
  limits.max_segments = 5000;
  const std::string bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    const bool is_xml = data[0] % 2 == 0;
    const auto map = std::make_shared<const StreetMap>(
        livemap::streets::ParseStreets(bytes, is_xml ? "osm" : "pbf", "input", limits));
    DriveAlong(map);
    DescribeAndDraw(*map, is_xml ? livemap::streets::ParseAddresses(bytes, "input")
                                 : livemap::streets::AddressMap());
  } catch (const livemap::Error&) {
    // Refused by a sentence: what the reader promises.
  }
  return 0;
}
