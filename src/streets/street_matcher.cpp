#include "streets/street_matcher.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "common/error.h"

namespace livemap::streets {
namespace {

constexpr double kLeastState = 1e-4;  // Less likely ones are dropped.
constexpr double kOffCourse = 0.15;   // Share of directions that fit a street by chance.
constexpr double kMetresPerRadian = 6'371'000;

/// One number for a travel.
std::uint64_t NumberOf(const Travel& travel) {
  return 2 * std::uint64_t{travel.segment} + (travel.forward ? 1 : 0);
}

void CheckMoreThanZero(const char* name, double value) {
  if (std::isfinite(value) && value > 0) return;
  throw Error("the street matcher's " + std::string(name) + " is " + std::to_string(value) +
              ", accepted is more than 0");
}

/// East and north of a place against another one near it, m. Right to half a percent.
Eigen::Vector2d OffsetM(const geo::GeoPoint& from, const geo::GeoPoint& to) {
  const double per_degree = kMetresPerRadian * geo::kRadiansPerDegree;
  const double narrower = std::cos(from.latitude_deg * geo::kRadiansPerDegree);
  return {std::remainder(to.longitude_deg - from.longitude_deg, 360) * per_degree * narrower,
          (to.latitude_deg - from.latitude_deg) * per_degree};
}

}  // namespace

StreetMatcher::StreetMatcher(std::shared_ptr<const StreetMap> map, const Config& config)
    : map_(std::move(map)), config_(config) {
  CheckMoreThanZero("radius in metres", config.radius_m);
  CheckMoreThanZero("sigma of the map in metres", config.map_sigma_m);
  CheckMoreThanZero("sigma of the course in radians", config.course_sigma_rad);
  CheckMoreThanZero("detour in metres", config.detour_m);
  CheckMoreThanZero("way of independent errors in metres", config.independent_m);
}

void StreetMatcher::Reset() {
  last_.reset();
  matches_.clear();
  off_street_ = 1;
}

double StreetMatcher::LengthM(std::uint32_t segment) const {
  const StreetMap::Segment& ends = map_->SegmentAt(segment);
  return OffsetM(map_->PlaceOf(ends.from), map_->PlaceOf(ends.to)).norm();
}

bool StreetMatcher::Add(const Position& position) {
  const bool finite = geo::IsValid(position.place) && std::isfinite(position.sigma_m) &&
                      std::isfinite(position.speed_mps) &&
                      std::isfinite(position.course_rad.value_or(0)) &&
                      std::isfinite(position.course_sigma_rad) && position.sigma_m >= 0;
  if (!finite) return false;
  const double moved_m = last_ ? OffsetM(last_->place, position.place).norm() : 0;
  if (last_ && moved_m < config_.min_move_m) return true;
  std::vector<StreetMatch> places = PlacesNear(position);
  if (!last_ || moved_m > config_.max_gap_m) {
    Begin(std::move(places));
  } else {
    Step(std::move(places), moved_m);
  }
  last_ = position;
  return true;
}

/// Both directions of each street near, where they are legal, with how well the position fits as
/// their probability: 1 where it could not fit better.
std::vector<StreetMatch> StreetMatcher::PlacesNear(const Position& position) const {
  std::vector<StreetMatch> places;
  const double radius_m = config_.radius_m + 3 * std::min(position.sigma_m, 100.0);
  for (const std::uint32_t segment : map_->SegmentsNear(position.place, radius_m)) {
    const StreetMap::Segment& ends = map_->SegmentAt(segment);
    const Eigen::Vector2d from_m = OffsetM(position.place, map_->PlaceOf(ends.from));
    const Eigen::Vector2d to_m = OffsetM(position.place, map_->PlaceOf(ends.to));
    const double length_m = (to_m - from_m).norm();
    if (!(length_m > 0)) continue;
    const Eigen::Vector2d ahead = (to_m - from_m) / length_m;
    const double along_m = std::clamp(-from_m.dot(ahead), 0.0, length_m);
    const Eigen::Vector2d nearest_m = from_m + along_m * ahead;
    if (nearest_m.norm() > radius_m) continue;
    const double side = ahead.x() * -nearest_m.y() + ahead.y() * nearest_m.x() >= 0 ? 1 : -1;
    for (const bool forward : {true, false}) {
      StreetMatch match;
      match.travel = {segment, forward};
      if (!map_->IsLegal(match.travel)) continue;
      match.along_m = forward ? along_m : length_m - along_m;
      match.left_m = (forward ? side : -side) * nearest_m.norm();
      const double sign = forward ? 1 : -1;
      match.probability =
          EmissionOf(match, std::atan2(sign * ahead.x(), sign * ahead.y()), position);
      places.push_back(match);
    }
  }
  return places;
}

double StreetMatcher::EmissionOf(const StreetMatch& place, double street_course_rad,
                                 const Position& position) const {
  const double variance = position.sigma_m * position.sigma_m +
                          config_.map_sigma_m * config_.map_sigma_m +
                          config_.street_sigma_m * config_.street_sigma_m;
  const double fit = std::exp(-0.5 * place.left_m * place.left_m / variance);
  if (!position.course_rad || position.speed_mps < config_.min_course_speed_mps) return fit;
  const double off_rad = std::remainder(street_course_rad - *position.course_rad, 2 * M_PI);
  const double course_variance = config_.course_sigma_rad * config_.course_sigma_rad +
                                 position.course_sigma_rad * position.course_sigma_rad;
  const double course_fit = std::exp(-0.5 * off_rad * off_rad / course_variance);
  return fit * (config_.wrong_course + (1 - config_.wrong_course) * course_fit);
}

/// The travels that the vehicle may come to from a state, legally and within a way, each once with
/// the shortest way: the state's own first.
std::vector<StreetMatcher::Reached> StreetMatcher::ReachedFrom(const StreetMatch& state,
                                                               double most_m) const {
  std::vector<Reached> reached{{state.travel, -state.along_m}};
  std::unordered_map<std::uint64_t, std::size_t> at{{NumberOf(state.travel), 0}};
  for (std::size_t i = 0; i < reached.size() && reached.size() < config_.max_reached; ++i) {
    const Reached here = reached[i];
    const double end_m = here.way_m + LengthM(here.travel.segment);
    if (end_m > most_m) continue;
    for (const Travel& next : map_->Continuations(here.travel)) {
      const auto [known, is_new] = at.emplace(NumberOf(next), reached.size());
      if (is_new) {
        reached.push_back({next, end_m});
      } else if (known->second > i) {
        reached[known->second].way_m = std::min(reached[known->second].way_m, end_m);
      }
    }
  }
  return reached;
}

void StreetMatcher::Begin(std::vector<StreetMatch> places) {
  double sum = 0;
  for (const StreetMatch& place : places) sum += place.probability;
  // Before anything else is known, one of them or none.
  const double off = std::exp(-0.5 * config_.off_street_sigmas * config_.off_street_sigmas);
  for (StreetMatch& place : places) place.probability *= 0.5 / std::max(1.0, sum);
  Keep(std::move(places), 0.5 * off + 0.25);
}

void StreetMatcher::Step(std::vector<StreetMatch> places, double moved_m) {
  std::unordered_map<std::uint64_t, std::size_t> place_of;
  for (std::size_t i = 0; i < places.size(); ++i) place_of.emplace(NumberOf(places[i].travel), i);
  std::vector<double> before(places.size(), off_street_ * config_.enters_streets);
  for (const StreetMatch& state : matches_) {
    for (const Reached& each : ReachedFrom(state, 1.5 * moved_m + 5 * config_.detour_m)) {
      const auto place = place_of.find(NumberOf(each.travel));
      if (place == place_of.end()) continue;
      const double way_m = each.way_m + places[place->second].along_m;
      before[place->second] +=
          state.probability * std::exp(-std::abs(way_m - moved_m) / config_.detour_m);
    }
    const auto back = place_of.find(NumberOf({state.travel.segment, !state.travel.forward}));
    if (back != place_of.end()) before[back->second] += state.probability * config_.turns_back;
  }
  // Neighbouring positions share their errors: each counts by how far the vehicle has come.
  const double counts = std::min(1.0, moved_m / config_.independent_m);
  for (std::size_t i = 0; i < places.size(); ++i) {
    places[i].probability = before[i] * std::pow(places[i].probability, counts);
  }
  const double sigmas = config_.off_street_sigmas;
  const double off_fit = kOffCourse * std::exp(-0.5 * sigmas * sigmas);
  const double off = off_street_ + (1 - off_street_) * config_.leaves_streets;
  Keep(std::move(places), off * std::pow(off_fit, counts));
}

/// Takes over the likeliest, scaled so that all add up to 1.
void StreetMatcher::Keep(std::vector<StreetMatch> places, double off) {
  double sum = off;
  for (const StreetMatch& place : places) sum += place.probability;
  matches_.clear();
  if (!(sum > 0) || !std::isfinite(sum)) {
    off_street_ = 1;
    return;
  }
  for (StreetMatch& place : places) {
    place.probability /= sum;
    if (place.probability >= kLeastState) matches_.push_back(place);
  }
  std::sort(matches_.begin(), matches_.end(), [](const StreetMatch& a, const StreetMatch& b) {
    return std::make_tuple(-a.probability, NumberOf(a.travel)) <
           std::make_tuple(-b.probability, NumberOf(b.travel));
  });
  if (matches_.size() > config_.max_states) matches_.resize(config_.max_states);
  double kept = 0;
  for (const StreetMatch& match : matches_) kept += match.probability;
  off_street_ = off / sum;
  if (kept > 0) {
    for (StreetMatch& match : matches_) match.probability *= (1 - off_street_) / kept;
  } else {
    off_street_ = 1;
  }
}

}  // namespace livemap::streets
