#include "streets/ways_ahead.h"

#include <algorithm>
#include <cmath>

namespace livemap::streets {
namespace {

constexpr int kMaxAngleSegments = 20;  // Of a way over which an angle is taken.
constexpr int kMaxRingSegments = 64;   // Of a roundabout.
constexpr double kStraightRad = 0.35;
constexpr double kTurnsBack = 0.2;  // At a dead end: else the map's end is not the street's.
constexpr int kLesserKinds = 2;     // So much less important a street is rarely turned into.

/// From one direction to another, to the left positive.
double TurnBetween(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  return std::atan2(from.x() * to.y() - from.y() * to.x(), from.dot(to));
}

}  // namespace

WaysAhead::WaysAhead(const Config& config, const StreetMap& map,
                     const std::vector<StreetMatch>& matches, const geo::LocalFrame& frame,
                     const Driving& driving, double way_m)
    : config_(config), map_(map), frame_(frame), driving_(driving) {
  double at_junction = 0;
  double until_node_m = 0;
  for (const StreetMatch& match : matches) {
    if (match.probability < config.least_probability) break;
    if (const std::optional<double> to_node_m = InJunctionM(match)) {
      at_junction += match.probability;
      until_node_m += match.probability * *to_node_m;
    } else {
      Add(match.travel, -1, -match.along_m, match.probability);
    }
  }
  if (at_junction > 0) {
    Add(*driving.approach, -1, 0, at_junction);
    legs_.back().start_m = until_node_m / at_junction - legs_.back().length_m();
  }
  for (std::size_t i = 0; i < legs_.size(); ++i) Extend(i, way_m);
  for (const Leg& leg : legs_) {
    nodes_.push_back(map_.StartOf(leg.travel));
    nodes_.push_back(map_.EndOf(leg.travel));
  }
  std::sort(nodes_.begin(), nodes_.end());
}

/// Within a junction the ways on lie too near each other for places to tell them apart: there the
/// vehicle counts as on the street by which it came. How far it is to the node, negative behind it.
std::optional<double> WaysAhead::InJunctionM(const StreetMatch& match) const {
  if (!driving_.approach) return std::nullopt;
  const Travel& approach = *driving_.approach;
  const double left_m = match.along_m;
  if (match.travel == approach) {
    const double length_m =
        (PlaceOf(map_.EndOf(approach)) - PlaceOf(map_.StartOf(approach))).norm();
    const double to_node_m = std::max(0.0, length_m - left_m);
    if (to_node_m <= config_.junction_m) return to_node_m;
    return std::nullopt;
  }
  if (map_.StartOf(match.travel) != map_.EndOf(approach) ||
      match.travel.segment == approach.segment || left_m > config_.junction_m) {
    return std::nullopt;
  }
  return -left_m;
}

bool WaysAhead::Touches(std::uint32_t segment) const {
  const StreetMap::Segment& ends = map_.SegmentAt(segment);
  return std::binary_search(nodes_.begin(), nodes_.end(), ends.from) ||
         std::binary_search(nodes_.begin(), nodes_.end(), ends.to);
}

Eigen::Vector2d WaysAhead::PlaceOf(std::uint32_t node) const {
  return frame_.ToEnu(map_.PlaceOf(node));
}

void WaysAhead::Add(const Travel& travel, int before, double start_m, double probability) {
  Leg leg;
  leg.travel = travel;
  leg.before = before;
  leg.from_m = PlaceOf(map_.StartOf(travel));
  leg.to_m = PlaceOf(map_.EndOf(travel));
  leg.start_m = start_m;
  leg.probability = probability;
  leg.ends = probability;
  legs_.push_back(leg);
}

void WaysAhead::Extend(std::size_t number, double way_m) {
  const Leg leg = legs_[number];
  const double end_m = leg.start_m + leg.length_m();
  if (end_m >= way_m) return;
  legs_[number].open = true;
  const std::vector<Travel> onwards = map_.Continuations(leg.travel);
  const std::vector<double> shares = SharesOf(leg, onwards);
  for (std::size_t i = 0; i < onwards.size(); ++i) {
    const double probability = leg.probability * shares[i];
    if (probability < config_.least_probability || legs_.size() >= config_.max_legs) continue;
    Add(onwards[i], static_cast<int>(number), end_m, probability);
    legs_[number].ends -= probability;
  }
}

const Leg& WaysAhead::RootOf(const Leg& leg) const {
  const Leg* root = &leg;
  while (root->before >= 0) root = &legs_[static_cast<std::size_t>(root->before)];
  return *root;
}

std::vector<double> WaysAhead::SharesOf(const Leg& leg, const std::vector<Travel>& onwards) const {
  if (onwards.empty()) return {};
  if (onwards.size() == 1) return {onwards[0].segment == leg.travel.segment ? kTurnsBack : 1};
  Approach approach;
  approach.distance_m = leg.start_m + leg.length_m();
  approach.speed_mps = driving_.speed_mps;
  approach.push_mps2 = driving_.push_mps2;
  approach.usual_mps = driving_.usual_mps;
  approach.turn_habit = driving_.turn_habit;
  const Street& street = map_.StreetOf(leg.travel.segment);
  approach.in_roundabout = street.roundabout;
  if (street.roundabout) {
    const std::optional<std::uint32_t> entry = RingEntryOf(leg);
    if (entry) approach.exits_left = ExitsLeft(leg, *entry);
  }
  const Eigen::Vector2d until = -DirectionAfter({leg.travel.segment, !leg.travel.forward});
  const Leg& root = RootOf(leg);
  // Before the street itself bends, the course says nothing of the junction behind the bend.
  const bool straight = std::abs(TurnBetween(root.to_m - root.from_m, until)) < kStraightRad;
  if (driving_.course_known && straight && !street.roundabout) {
    const Eigen::Vector2d course(std::sin(driving_.course_rad), std::cos(driving_.course_rad));
    approach.bend_rad = TurnBetween(until, course);
    approach.bend_sigma_rad = driving_.course_sigma_rad;
    approach.bend_known = true;
  }
  std::vector<TurnOption> options;
  options.reserve(onwards.size());
  for (const Travel& next : onwards) options.push_back(OptionOf(leg, next));
  return TurnProbabilities(config_.turns, approach, options);
}

/// Where the way that ends with a leg of a ring comes into the ring.
std::optional<std::uint32_t> WaysAhead::RingEntryOf(const Leg& leg) const {
  const Leg* ring = &leg;
  while (ring->before >= 0) {
    const Leg& before = legs_[static_cast<std::size_t>(ring->before)];
    if (!map_.StreetOf(before.travel.segment).roundabout) return map_.StartOf(ring->travel);
    ring = &before;
  }
  return driving_.ring_entry;
}

/// From the end of a leg of a ring on, once around at most.
int WaysAhead::ExitsLeft(const Leg& leg, std::uint32_t entry) const {
  int exits = 0;
  Travel travel = leg.travel;
  for (int i = 0; i < kMaxRingSegments && map_.EndOf(travel) != entry; ++i) {
    const Travel* onwards = nullptr;
    const std::vector<Travel> ways = map_.Continuations(travel);
    for (const Travel& way : ways) {
      if (map_.StreetOf(way.segment).roundabout) {
        onwards = &way;
      } else {
        ++exits;
      }
    }
    if (onwards == nullptr) break;
    travel = Travel(*onwards);
  }
  return exits;
}

TurnOption WaysAhead::OptionOf(const Leg& leg, const Travel& next) const {
  TurnOption option;
  const Eigen::Vector2d until = -DirectionAfter({leg.travel.segment, !leg.travel.forward});
  option.angle_rad = TurnBetween(until, DirectionAfter(next));
  const Street& here = map_.StreetOf(leg.travel.segment);
  const Street& there = map_.StreetOf(next.segment);
  option.same_street = here.id == there.id || (here.name != 0 && here.name == there.name);
  option.ring = there.roundabout;
  option.lesser = static_cast<int>(there.kind) - static_cast<int>(here.kind) >= kLesserKinds;
  return option;
}

/// From a travel's begin to where the street leads until the next choice, as far as angles need it.
Eigen::Vector2d WaysAhead::DirectionAfter(Travel travel) const {
  const Eigen::Vector2d start_m = PlaceOf(map_.StartOf(travel));
  Eigen::Vector2d end_m = PlaceOf(map_.EndOf(travel));
  double way_m = (end_m - start_m).norm();
  for (int i = 0; i < kMaxAngleSegments && way_m < config_.angle_way_m; ++i) {
    const Travel next = map_.OnlyContinuation(travel);
    if (next == travel) break;
    const Eigen::Vector2d next_m = PlaceOf(map_.EndOf(next));
    way_m += (next_m - end_m).norm();
    end_m = next_m;
    travel = next;
  }
  return end_m - start_m;
}

}  // namespace livemap::streets
