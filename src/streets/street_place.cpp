#include "streets/street_place.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace livemap::streets {
namespace {

constexpr double kReachM = 25;
constexpr double kMaxReachM = 60;
constexpr double kMapSigmaM = 3;          // Of the map's line beside the place of a hazard.
constexpr double kCourseSigmaRad = 0.35;  // Between a course and the street that is driven.
constexpr double kWrongCourse = 8;        // Log likelihood; of a course that says nothing.
constexpr double kServiceCost = 1;        // Car parks and drives are seldom reported on.
constexpr double kNearlyAsLikely = 2;     // Log likelihood.
constexpr double kAlongRad = 60 * geo::kRadiansPerDegree;
constexpr double kOppositeRad = 120 * geo::kRadiansPerDegree;
constexpr double kCrossingReachM = 400;
constexpr double kAtCrossingM = 50;
constexpr double kHouseReachM = 40;
constexpr std::size_t kMaxCrossingNodes = 300;

struct Candidate {
  Carriageway carriageway;
  double cost = 0;
  bool one_way = false;
};

double AngleBetween(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, 2 * M_PI));
}

/// East and north of `from`, m; right to a thousandth over some hundred metres.
Eigen::Vector2d FlatOffset(const geo::GeoPoint& from, const geo::GeoPoint& to) {
  constexpr double kMPerDegree = 111'195;
  return {kMPerDegree * std::cos(from.latitude_deg * geo::kRadiansPerDegree) *
              (to.longitude_deg - from.longitude_deg),
          kMPerDegree * (to.latitude_deg - from.latitude_deg)};
}

double OffM(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m) {
  const Eigen::Vector2d along = to_m - from_m;
  const double squared = along.squaredNorm();
  const double share = squared > 0 ? std::clamp(-from_m.dot(along) / squared, 0.0, 1.0) : 0;
  return (from_m + share * along).norm();
}

/// The legal direction of the segment that fits the course best, and by how much it does not.
double FitCourse(const StreetMap& map, double course_rad, double forward_rad,
                 Carriageway& carriageway) {
  const Street& street = map.StreetOf(carriageway.travel.segment);
  const double backward_rad = std::remainder(forward_rad + M_PI, 2 * M_PI);
  bool forward = street.forward;
  if (street.forward && street.backward && !std::isnan(course_rad)) {
    forward = AngleBetween(course_rad, forward_rad) <= AngleBetween(course_rad, backward_rad);
  }
  carriageway.travel.forward = forward;
  carriageway.bearing_rad = forward ? forward_rad : backward_rad;
  if (std::isnan(course_rad)) {
    carriageway.is_directed = street.one_way();
    return 0;
  }
  const double angle_rad = AngleBetween(course_rad, carriageway.bearing_rad);
  carriageway.is_directed = angle_rad <= kAlongRad;
  return std::min(kWrongCourse, 0.5 * std::pow(angle_rad / kCourseSigmaRad, 2));
}

std::optional<Candidate> CandidateOf(const StreetMap& map, const Spot& spot, std::uint32_t segment,
                                     double reach_m) {
  const StreetMap::Segment& ends = map.SegmentAt(segment);
  const Eigen::Vector2d from_m = FlatOffset(spot.place, map.PlaceOf(ends.from));
  const Eigen::Vector2d to_m = FlatOffset(spot.place, map.PlaceOf(ends.to));
  const double off_m = OffM(from_m, to_m);
  const Street& street = map.StreetOf(segment);
  if (off_m > reach_m || (!street.forward && !street.backward)) return std::nullopt;
  const double half_m = 0.5 * street.HalfWidthM();
  const double variance_m2 =
      spot.sigma_m * spot.sigma_m + kMapSigmaM * kMapSigmaM + half_m * half_m;
  Candidate candidate;
  candidate.carriageway.travel.segment = segment;
  candidate.carriageway.is_certain = true;
  candidate.one_way = street.one_way();
  candidate.cost = 0.5 * off_m * off_m / variance_m2;
  if (street.kind == StreetKind::kService) candidate.cost += kServiceCost;
  const Eigen::Vector2d along = to_m - from_m;
  candidate.cost +=
      FitCourse(map, spot.course_rad, std::atan2(along.x(), along.y()), candidate.carriageway);
  return candidate;
}

bool IsNameOfOther(const StreetMap& map, std::uint32_t segment, std::uint32_t name) {
  const std::uint32_t other = map.StreetOf(segment).name;
  return other != 0 && other != name;
}

/// A node that is reached along the street.
struct ReachedNode {
  double way_m;
  std::uint32_t node;
};

bool IsFurther(const ReachedNode& a, const ReachedNode& b) {
  return a.way_m != b.way_m ? a.way_m > b.way_m : a.node > b.node;
}

struct Crossing {
  std::string name;  // Of the street that crosses; empty: there is none.
  double way_m = 0;
};

/// The street that crosses next, along the street in both directions.
Crossing NearestCrossing(const StreetMap& map, const geo::GeoPoint& place, std::uint32_t segment) {
  const std::uint32_t street = map.SegmentAt(segment).street;
  const std::uint32_t name = map.StreetOf(segment).name;
  std::vector<ReachedNode> open;
  for (const std::uint32_t node : {map.SegmentAt(segment).from, map.SegmentAt(segment).to}) {
    open.push_back({FlatOffset(place, map.PlaceOf(node)).norm(), node});
  }
  std::vector<std::uint32_t> seen;
  std::make_heap(open.begin(), open.end(), IsFurther);
  while (!open.empty() && seen.size() < kMaxCrossingNodes) {
    std::pop_heap(open.begin(), open.end(), IsFurther);
    const ReachedNode here = open.back();
    open.pop_back();
    if (here.way_m > kCrossingReachM) break;
    if (std::find(seen.begin(), seen.end(), here.node) != seen.end()) continue;
    seen.push_back(here.node);
    const std::vector<std::uint32_t> at = map.SegmentsAt(here.node);
    for (const std::uint32_t next : at) {
      if (IsNameOfOther(map, next, name)) return {map.NameOf(map.StreetOf(next)), here.way_m};
    }
    for (const std::uint32_t next : at) {
      const StreetMap::Segment& ends = map.SegmentAt(next);
      const bool same = name == 0 ? ends.street == street : map.StreetOf(next).name == name;
      if (!same) continue;
      const std::uint32_t node = ends.from == here.node ? ends.to : ends.from;
      const double length_m = FlatOffset(map.PlaceOf(here.node), map.PlaceOf(node)).norm();
      open.push_back({here.way_m + length_m, node});
      std::push_heap(open.begin(), open.end(), IsFurther);
    }
  }
  return {};
}

const char* BoundFor(double bearing_rad) {
  constexpr std::array<const char*, 4> kBounds{"northbound", "eastbound", "southbound",
                                               "westbound"};
  const double quarters = std::round(bearing_rad / (M_PI / 2));
  return kBounds[static_cast<std::size_t>(static_cast<int>(quarters) + 4) % 4];
}

const char* WhyUndirected(const Spot& spot, const Carriageway& on) {
  if (!on.is_certain) return "carriageways of both directions lie equally near";
  return std::isnan(spot.course_rad)
             ? "the course of the vehicle that reported it is not known"
             : "the vehicle that reported it did not drive along the street";
}

}  // namespace

std::optional<Carriageway> FindCarriageway(const StreetMap& map, const Spot& spot) {
  const double reach_m = std::min(kMaxReachM, kReachM + 2 * std::max(0.0, spot.sigma_m));
  std::vector<Candidate> candidates;
  for (const std::uint32_t segment : map.SegmentsNear(spot.place, reach_m)) {
    if (auto candidate = CandidateOf(map, spot, segment, reach_m)) {
      candidates.push_back(*candidate);
    }
  }
  if (candidates.empty()) return std::nullopt;
  const auto by_cost = [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; };
  Candidate best = *std::min_element(candidates.begin(), candidates.end(), by_cost);
  for (const Candidate& other : candidates) {
    if (other.cost > best.cost + kNearlyAsLikely || !best.one_way || !other.one_way) continue;
    const double angle_rad =
        AngleBetween(other.carriageway.bearing_rad, best.carriageway.bearing_rad);
    if (angle_rad > kOppositeRad) best.carriageway.is_certain = false;
  }
  return best.carriageway;
}

bool LieOnOppositeCarriageways(const StreetMap& map, const Carriageway& a, const Carriageway& b) {
  return a.is_certain && b.is_certain && a.is_directed && b.is_directed &&
         map.StreetOf(a.travel.segment).one_way() && map.StreetOf(b.travel.segment).one_way() &&
         AngleBetween(a.bearing_rad, b.bearing_rad) > kOppositeRad;
}

StreetWords DescribeSpot(const StreetMap& map, const Spot& spot, const AddressMap* addresses) {
  StreetWords words;
  const std::optional<Carriageway> on = FindCarriageway(map, spot);
  if (!on) {
    words.note = "no street of the street file is near";
    return words;
  }
  words.street = map.NameOf(map.StreetOf(on->travel.segment));
  const Crossing crossing = NearestCrossing(map, spot.place, on->travel.segment);
  words.near = crossing.name;
  if (addresses != nullptr && (crossing.name.empty() || crossing.way_m > kAtCrossingM)) {
    const std::string house = addresses->NumberNear(spot.place, words.street, kHouseReachM);
    if (!house.empty()) words.near = "no. " + house;
  }
  if (on->is_directed && on->is_certain) {
    words.direction = BoundFor(on->bearing_rad);
  } else {
    words.note = WhyUndirected(spot, *on);
  }
  if (words.street.empty()) words.note = "the street has no name in the street file";
  return words;
}

}  // namespace livemap::streets
