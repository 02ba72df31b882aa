#include "vehicle/alerts/street_way.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace livemap::vehicle {
namespace {

constexpr double kMaxWayM = 1000;
constexpr double kMuchDenser = 3;        // A street's edge is half as dense as its middle.
constexpr double kLeftRingM = 15;        // So far on another street a ring is left behind.
constexpr double kAgainstCosine = -0.5;  // Of a one-way street to the course.
constexpr double kParallelCosine = 0.8;  // Streets of the same level cross at more than this.

double NormalBelow(double value) { return 0.5 * std::erfc(-value / std::sqrt(2)); }

/// How a place lies to a straight piece.
struct Beside {
  double along_m;  // From its begin, not beyond its ends.
  double off_m;    // To the nearest place of it.
  double left_m;
  bool before;  // It lies behind the begin.
};

Beside BesideOf(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m,
                const Eigen::Vector2d& place_m) {
  const double length_m = (to_m - from_m).norm();
  const Eigen::Vector2d ahead =
      length_m > 0 ? Eigen::Vector2d((to_m - from_m) / length_m) : Eigen::Vector2d(0, 1);
  const Eigen::Vector2d off = place_m - from_m;
  const double along_m = std::clamp(ahead.dot(off), 0.0, length_m);
  const double left_m = ahead.x() * off.y() - ahead.y() * off.x();
  return {along_m, (off - along_m * ahead).norm(), left_m, ahead.dot(off) < 0};
}

}  // namespace

StreetWay::StreetWay(std::shared_ptr<const streets::StreetMap> map, const Config& config)
    : map_(std::move(map)), config_(config), matcher_(map_, config.matcher), habit_(config.habit) {}

void StreetWay::Reset() {
  matcher_.Reset();
  usual_mps_ = 0;
  last_.reset();
  habit_.Reset();
  approach_.reset();
  ring_entry_.reset();
  legs_.clear();
  others_.clear();
}

void StreetWay::Add(const geo::GeoPoint& position, double sigma_m, const CourseFilter& filter) {
  const double speed = filter.known() ? filter.state()[CourseFilter::kSpeed] : 0;
  const double moved_m = last_ ? geo::GeodesicDistanceM(*last_, position) : 0;
  last_ = position;
  usual_mps_ = std::max(speed, usual_mps_ * std::exp(-moved_m / config_.usual_way_m));
  streets::StreetMatcher::Position now;
  now.place = position;
  now.sigma_m = config_.matched_fraction * sigma_m;
  now.speed_mps = speed;
  if (filter.known()) {
    const double variance = filter.covariance()(CourseFilter::kCourse, CourseFilter::kCourse);
    now.course_rad = filter.state()[CourseFilter::kCourse];
    now.course_sigma_rad = std::sqrt(std::max(0.0, variance));
  }
  matcher_.Add(now);
  FollowJunction();
}

/// Keeps in mind by which street the vehicle comes to a junction, until it has left that behind.
void StreetWay::FollowJunction() {
  if (matcher_.matches().empty()) {
    approach_.reset();
    return;
  }
  const streets::StreetMatch& likeliest = matcher_.matches().front();
  const double zone_m = config_.ways.junction_m;
  if (approach_) {
    const bool in_it = map_->StartOf(likeliest.travel) == map_->EndOf(*approach_) &&
                       likeliest.travel.segment != approach_->segment &&
                       likeliest.along_m <= zone_m;
    if (in_it || likeliest.travel == *approach_) return;
    NotePassed(*approach_, likeliest.travel);
    approach_.reset();
  }
  const streets::Street& street = map_->StreetOf(likeliest.travel.segment);
  if (street.roundabout) {
    if (!ring_entry_) ring_entry_ = RingEntryAhead();
  } else if (likeliest.along_m > kLeftRingM) {
    ring_entry_.reset();
  }
  const bool choice = map_->Continuations(likeliest.travel).size() > 1;
  if (choice && !street.roundabout) approach_ = likeliest.travel;
}

/// From the direction of one travel to that of another, without a sign.
double StreetWay::AngleRad(const streets::Travel& from, const streets::Travel& onto) const {
  const geo::LocalFrame frame(map_->PlaceOf(map_->EndOf(from)));
  const auto direction = [&](const streets::Travel& travel) -> Eigen::Vector2d {
    return frame.ToEnu(map_->PlaceOf(map_->EndOf(travel))) -
           frame.ToEnu(map_->PlaceOf(map_->StartOf(travel)));
  };
  const double cosine = direction(from).stableNormalized().dot(direction(onto).stableNormalized());
  return std::acos(std::clamp(cosine, -1.0, 1.0));
}

/// Learns whether the driver turns, where straight on and turns were possible.
void StreetWay::NotePassed(const streets::Travel& approach, const streets::Travel& now) {
  bool straight = false;
  bool turn = false;
  const double straight_rad = config_.ways.turns.straight_rad;
  for (const streets::Travel& onto : map_->Continuations(approach)) {
    if (map_->StreetOf(onto.segment).roundabout) return;
    (AngleRad(approach, onto) < straight_rad ? straight : turn) = true;
  }
  if (straight && turn) habit_.Passed(AngleRad(approach, now) >= straight_rad);
}

void StreetWay::LookAhead(const geo::LocalFrame& frame, const CourseFilter& filter, double way_m) {
  streets::Driving driving;
  driving.speed_mps = filter.state()[CourseFilter::kSpeed];
  driving.push_mps2 = filter.state()[CourseFilter::kAcceleration];
  driving.usual_mps = usual_mps_;
  driving.course_rad = filter.state()[CourseFilter::kCourse];
  driving.course_known = driving.speed_mps >= config_.bend_from_mps;
  driving.course_sigma_rad =
      std::sqrt(std::max(0.0, filter.covariance()(CourseFilter::kCourse, CourseFilter::kCourse)));
  driving.turn_habit = habit_.factor();
  driving.approach = approach_;
  driving.ring_entry = ring_entry_;
  const double reach_m = std::min(way_m, kMaxWayM);
  const streets::WaysAhead ways(config_.ways, *map_, matcher_.matches(), frame, driving, reach_m);
  legs_ = ways.legs();
  others_.clear();
  if (!last_) return;
  const Eigen::Vector2d course(std::sin(driving.course_rad), std::cos(driving.course_rad));
  for (const std::uint32_t segment : map_->SegmentsNear(*last_, reach_m)) {
    const streets::StreetMap::Segment& ends = map_->SegmentAt(segment);
    const streets::Street& street = map_->StreetOf(segment);
    const Eigen::Vector2d from_m = frame.ToEnu(map_->PlaceOf(ends.from));
    const Eigen::Vector2d to_m = frame.ToEnu(map_->PlaceOf(ends.to));
    const double cosine =
        (street.forward ? 1 : -1) * course.dot((to_m - from_m).stableNormalized());
    const bool against = driving.course_known && street.one_way() && cosine < kAgainstCosine;
    // A one-way street begins where it is driven from.
    const bool turned = street.one_way() && street.backward;
    others_.push_back({turned ? to_m : from_m, turned ? from_m : to_m, street.HalfWidthM(),
                       street.layer, ways.Touches(segment), against, street.one_way()});
  }
}

/// Of the likeliest way that led into a ring when the vehicle looked ahead last.
std::optional<std::uint32_t> StreetWay::RingEntryAhead() const {
  const streets::Leg* entry = nullptr;
  for (const streets::Leg& leg : legs_) {
    if (leg.before < 0 || !map_->StreetOf(leg.travel.segment).roundabout) continue;
    const streets::Leg& before = legs_[static_cast<std::size_t>(leg.before)];
    if (map_->StreetOf(before.travel.segment).roundabout) continue;
    if (entry == nullptr || leg.probability > entry->probability) entry = &leg;
  }
  if (entry == nullptr) return std::nullopt;
  return map_->StartOf(entry->travel);
}

/// Of a place so far off the middle of a carriageway, over which hazards are evenly spread.
double StreetWay::Density(double off_m, double half_width_m, double variance_m2) const {
  const double sigma_m = std::sqrt(variance_m2 + config_.map_sigma_m * config_.map_sigma_m);
  return (NormalBelow((off_m + half_width_m) / sigma_m) -
          NormalBelow((off_m - half_width_m) / sigma_m)) /
         (2 * half_width_m);
}

/// Of the course of who passed a place that lies on a street along a vector, against courses that
/// are spread evenly. 1 where it is not known.
double StreetWay::PassedDensity(const Eigen::Vector2d& along, bool one_way,
                                double passed_rad) const {
  if (!std::isfinite(passed_rad)) return 1;
  const double sigma_rad = config_.passed_sigma_rad;
  const double peak = std::sqrt(2 * M_PI) / sigma_rad;
  const auto density = [&](double off_rad) {
    const double sigmas = std::remainder(off_rad, 2 * M_PI) / sigma_rad;
    return peak * std::exp(-0.5 * sigmas * sigmas);
  };
  const double off_rad = passed_rad - std::atan2(along.x(), along.y());
  // In which lane of a street a place lies is not known: it may be passed in either direction.
  const double fits =
      one_way ? density(off_rad) : 0.5 * (density(off_rad) + density(off_rad + M_PI));
  return config_.passed_wrong + (1 - config_.passed_wrong) * fits;
}

std::vector<StreetWay::OtherNear> StreetWay::OthersNear(const Eigen::Vector2d& place_m,
                                                        double variance_m2,
                                                        double passed_rad) const {
  const double reach_m = 4 * std::sqrt(variance_m2 + config_.map_sigma_m * config_.map_sigma_m);
  std::vector<OtherNear> near;
  for (const Other& other : others_) {
    const Beside beside = BesideOf(other.from_m, other.to_m, place_m);
    if (beside.off_m > other.half_width_m + reach_m) continue;
    const Eigen::Vector2d along = other.to_m - other.from_m;
    near.push_back({along, other.layer, other.meets, other.against,
                    Density(beside.off_m, other.half_width_m, variance_m2),
                    PassedDensity(along, other.one_way, passed_rad)});
  }
  return near;
}

/// The densest of the streets that count against the way's own: those on another level, those
/// beside it without meeting it that are denser, and all that are much denser. Where streets meet,
/// a place lies on both.
double StreetWay::OtherDensity(const std::vector<OtherNear>& others, double own, double own_passed,
                               const streets::Leg& leg) const {
  const int layer = map_->StreetOf(leg.travel.segment).layer;
  const Eigen::Vector2d ahead = (leg.to_m - leg.from_m).normalized();
  double most = 0;
  for (const OtherNear& other : others) {
    const bool parallel = std::abs(ahead.dot(other.along)) > kParallelCosine * other.along.norm();
    const bool beside = parallel && !other.meets && other.density > own;
    const bool other_level = other.layer != layer && !other.meets;
    const bool counts = other_level || beside || other.density > kMuchDenser * own;
    const double weight = other_level ? config_.other_level_weight : 1;
    // Both streets have what lies where they meet, whichever of them it was passed on.
    const double fits = other.meets ? 1 : other.passed / own_passed;
    if (counts) most = std::max(most, weight * fits * other.density);
  }
  return most;
}

StreetWay::Relation StreetWay::RelationOf(const Eigen::Vector2d& place_m, double variance_m2,
                                          double passed_rad) const {
  struct Best {
    double density = 0;
    double way_m = 0;
    double left_m = 0;
    std::size_t leg = 0;
    double passed = 1;
  };
  Relation relation;
  double matched = 0;
  double open = 0;
  double chosen = 0;
  std::vector<Best> best(legs_.size());
  const std::vector<OtherNear> others = OthersNear(place_m, variance_m2, passed_rad);
  for (const OtherNear& other : others) {
    if (other.against) relation.against = std::max(relation.against, other.density);
  }
  for (std::size_t i = 0; i < legs_.size(); ++i) {
    const streets::Leg& leg = legs_[i];
    if (leg.before < 0) matched += leg.probability;
    if (leg.before >= 0) best[i] = best[static_cast<std::size_t>(leg.before)];
    const Beside beside = BesideOf(leg.from_m, leg.to_m, place_m);
    const double way_m = leg.start_m + beside.along_m;
    if (way_m > 0 && !(leg.before < 0 && beside.before)) {
      const streets::Street& street = map_->StreetOf(leg.travel.segment);
      const double density = Density(beside.off_m, street.HalfWidthM(), variance_m2);
      if (density > best[i].density) {
        const double passed = PassedDensity(leg.to_m - leg.from_m, street.one_way(), passed_rad);
        best[i] = {density, way_m, beside.left_m, i, passed};
      }
    }
    if (leg.ends <= 0) continue;
    double on_leg = 0;
    if (best[i].density > 0.01 * config_.others_per_m) {
      const double other =
          OtherDensity(others, best[i].density, best[i].passed, legs_[best[i].leg]);
      on_leg = best[i].density / (best[i].density + other + config_.others_per_m);
    }
    if (leg.open && on_leg < 0.5) {
      open += leg.ends;
      continue;
    }
    relation.probability += leg.ends * on_leg;
    if (on_leg > 0.3) relation.path += leg.ends;
    if (leg.ends * on_leg > chosen && on_leg > 0.1) {
      chosen = leg.ends * on_leg;
      relation.ahead = true;
      relation.way_m = best[i].way_m;
      relation.left_m = best[i].left_m;
    }
  }
  if (matched > 0) relation.path /= matched;
  relation.unknown = std::clamp(1 - matched + open, 0.0, 1.0);
  return relation;
}

}  // namespace livemap::vehicle
