#include "protocol/trail.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/error.h"
#include "common/number_text.h"
#include "geo/polyline.h"

namespace livemap::protocol {
namespace {

constexpr double kOffsetsPerM = 10;
constexpr double kTextPerDegree = 1e7;  // A centimetre.
constexpr double kOffLineM = 1.5;

/// Appends the numbers of the places between `first` and `last` that the line needs, and of the
/// last one (D. Douglas, T. Peucker 1973).
void AppendBends(const std::vector<Eigen::Vector2d>& places, std::size_t first, std::size_t last,
                 double off_line_m, std::vector<std::size_t>& bends) {
  double furthest_m = 0;
  std::size_t furthest = first;
  for (std::size_t i = first + 1; i < last; ++i) {
    const double off_m = geo::OffLineM(places[first], places[last], places[i]);
    if (off_m > furthest_m) {
      furthest_m = off_m;
      furthest = i;
    }
  }
  if (furthest_m > off_line_m) {
    AppendBends(places, first, furthest, off_line_m, bends);
    AppendBends(places, furthest, last, off_line_m, bends);
  } else {
    bends.push_back(last);
  }
}

bool IsTrail(const Trail& trail, const geo::LocalFrame& frame) {
  if (trail.size() < 2 || trail.size() > kMaxTrailPlaces) return false;
  return std::all_of(trail.begin(), trail.end(), [&](const geo::GeoPoint& place) {
    return geo::IsValid(place) && frame.ToEnu(place).norm() <= kMaxTrailOffsetM;
  });
}

}  // namespace

std::vector<Trail> ValidTrails(const std::vector<Trail>& trails, const geo::GeoPoint& hazard) {
  std::vector<Trail> valid;
  if (trails.empty() || !geo::IsValid(hazard)) return valid;
  const geo::LocalFrame frame(hazard);
  for (const Trail& trail : trails) {
    if (valid.size() < kMaxTrails && IsTrail(trail, frame)) valid.push_back(trail);
  }
  return valid;
}

Trail SimplifiedTrail(const Trail& trail) {
  const geo::LocalFrame frame(trail.front());
  std::vector<Eigen::Vector2d> places;
  for (const geo::GeoPoint& place : trail) places.push_back(frame.ToEnu(place));
  std::vector<std::size_t> bends;
  for (double off_m = kOffLineM; bends.empty() || bends.size() > kMaxTrailPlaces; off_m *= 1.5) {
    bends.assign(1, 0);
    AppendBends(places, 0, places.size() - 1, off_m, bends);
  }
  Trail simplified;
  for (const std::size_t bend : bends) simplified.push_back(trail[bend]);
  return simplified;
}

bool AreSame(const Trail& a, const Trail& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const geo::GeoPoint& one, const geo::GeoPoint& other) {
                      return one.latitude_deg == other.latitude_deg &&
                             one.longitude_deg == other.longitude_deg;
                    });
}

bool AreSame(const std::vector<Trail>& a, const std::vector<Trail>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const Trail& one, const Trail& other) { return AreSame(one, other); });
}

std::vector<std::int16_t> ToTrailOffsets(const Trail& trail, const geo::GeoPoint& hazard) {
  std::vector<std::int16_t> offsets;
  if (!geo::IsValid(hazard)) return offsets;
  const geo::LocalFrame frame(hazard);
  if (!IsTrail(trail, frame)) return offsets;
  for (const geo::GeoPoint& place : trail) {
    const Eigen::Vector2d offset_m = frame.ToEnu(place);
    for (const double each_m : {offset_m.x(), offset_m.y()}) {
      offsets.push_back(static_cast<std::int16_t>(std::lround(kOffsetsPerM * each_m)));
    }
  }
  return offsets;
}

Trail FromTrailOffsets(const std::vector<std::int16_t>& offsets, const geo::GeoPoint& hazard) {
  const bool is_list = offsets.size() % 2 == 0 && offsets.size() >= 4 &&
                       offsets.size() <= 2 * kMaxTrailPlaces && geo::IsValid(hazard);
  if (!is_list) {
    throw Error("trail of a hazard has " + std::to_string(offsets.size()) +
                " offsets, accepted are two for each of 2 to " + std::to_string(kMaxTrailPlaces) +
                " places, of a hazard with a valid place");
  }
  const geo::LocalFrame frame(hazard);
  Trail trail;
  for (std::size_t i = 0; i < offsets.size(); i += 2) {
    trail.push_back(
        frame.ToGeo(Eigen::Vector2d(offsets[i] / kOffsetsPerM, offsets[i + 1] / kOffsetsPerM)));
  }
  return trail;
}

std::string TrailsText(const std::vector<Trail>& trails) {
  std::string text;
  for (const Trail& trail : trails) {
    AppendNumber(text, trail.size());
    for (const geo::GeoPoint& place : trail) {
      AppendNumber(text, std::llround(place.latitude_deg * kTextPerDegree));
      AppendNumber(text, std::llround(place.longitude_deg * kTextPerDegree));
    }
  }
  return text;
}

std::vector<Trail> ParseTrails(const std::string& text) {
  std::vector<Trail> trails;
  NumberReader reader(text);
  while (!reader.done() && trails.size() < kMaxTrails) {
    std::size_t size = 0;
    reader.Read(size);
    if (!reader.good() || size < 2 || size > kMaxTrailPlaces) break;
    Trail trail;
    for (std::size_t i = 0; i < size; ++i) {
      std::int64_t latitude = 0;
      std::int64_t longitude = 0;
      reader.Read(latitude);
      reader.Read(longitude);
      trail.push_back({static_cast<double>(latitude) / kTextPerDegree,
                       static_cast<double>(longitude) / kTextPerDegree});
    }
    const bool valid = reader.good() && std::all_of(trail.begin(), trail.end(), geo::IsValid);
    if (!valid) break;
    trails.push_back(std::move(trail));
  }
  if (reader.good() && reader.done() && TrailsText(trails).size() == text.size()) return trails;
  throw Error("a hazard's trails are no such text: accepted are up to " +
              std::to_string(kMaxTrails) +
              " trails, each its number of places and then latitude and longitude of each, 1e-7 "
              "degrees");
}

}  // namespace livemap::protocol
