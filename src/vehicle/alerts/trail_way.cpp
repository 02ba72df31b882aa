#include "vehicle/alerts/trail_way.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace livemap::vehicle {
namespace {

constexpr double kShortestM = 0.5;  // A shorter piece of a trail has no direction.
constexpr double kFurthestBesideM = 80;
constexpr double kSameDirectionRad = 0.4;

double CourseAlong(const Eigen::Vector2d& way) { return std::atan2(way.x(), way.y()); }

}  // namespace

std::optional<TrailWay::Foot> TrailWay::FootOf(const DrivenPlace& driven, double across_m2,
                                               double course_rad2) const {
  const double at_place = 1 / std::sqrt(2 * M_PI * across_m2);
  const double at_course = 1 / std::sqrt(2 * M_PI * course_rad2);
  std::optional<Foot> best;
  bool beside = false;
  for (std::size_t i = 0; i + 1 < places_m_.size(); ++i) {
    const Eigen::Vector2d way = places_m_[i + 1] - places_m_[i];
    const double length_m = way.norm();
    if (length_m < kShortestM) continue;
    const double share = way.dot(driven.place_m - places_m_[i]) / (length_m * length_m);
    if (share > 1 && i + 2 == places_m_.size()) continue;  // Past the hazard.
    Foot foot;
    foot.segment = i;
    foot.share = std::clamp(share, i == 0 ? -config_.before_m / length_m : 0.0, 1.0);
    const double off_m = (driven.place_m - places_m_[i] - foot.share * way).norm();
    const double turned_rad = std::remainder(driven.course_rad - CourseAlong(way), 2 * M_PI);
    const double place = at_place * std::exp(-0.5 * off_m * off_m / across_m2);
    const double course = at_course * std::exp(-0.5 * turned_rad * turned_rad / course_rad2);
    const double other_course =
        config_.parallel_share * course + (1 - config_.parallel_share) / (2 * M_PI);
    foot.log_odds =
        std::log(std::max(1e-12, place * course)) - std::log(config_.others_per_m * other_course);
    beside = beside || (share > 0 && share < 1 && std::abs(turned_rad) < kSameDirectionRad &&
                        off_m < kFurthestBesideM);
    if (!best || foot.log_odds > best->log_odds) best = foot;
  }
  if (best) best->beside = beside;
  return best;
}

double TrailWay::WayM(const Foot& foot) const {
  double sum = (1 - foot.share) * (places_m_[foot.segment + 1] - places_m_[foot.segment]).norm();
  for (std::size_t i = foot.segment + 1; i + 1 < places_m_.size(); ++i) {
    sum += (places_m_[i + 1] - places_m_[i]).norm();
  }
  return sum;
}

/// Way to the first corner; negative where there is none before the hazard.
double TrailWay::CornerAheadM(const Foot& foot) const {
  struct Turn {
    double at_m;
    double by_rad;
  };
  std::vector<Turn> turns;
  double at_m = (1 - foot.share) * (places_m_[foot.segment + 1] - places_m_[foot.segment]).norm();
  for (std::size_t i = foot.segment + 1; i + 1 < places_m_.size(); ++i) {
    const Eigen::Vector2d in = places_m_[i] - places_m_[i - 1];
    const Eigen::Vector2d out = places_m_[i + 1] - places_m_[i];
    if (out.norm() < kShortestM) continue;
    turns.push_back({at_m, std::remainder(CourseAlong(out) - CourseAlong(in), 2 * M_PI)});
    at_m += out.norm();
  }
  for (std::size_t first = 0; first < turns.size(); ++first) {
    double turned_rad = 0;
    for (std::size_t i = first; i < turns.size(); ++i) {
      if (turns[i].at_m - turns[first].at_m > config_.corner_way_m) break;
      turned_rad += turns[i].by_rad;
      if (std::abs(turned_rad) > config_.corner_rad) return turns[first].at_m;
    }
  }
  return -1;
}

double TrailWay::Follows(const Foot& foot, const CourseFilter& filter) const {
  const double speed = filter.state()[CourseFilter::kSpeed];
  const double braking = -filter.state()[CourseFilter::kAcceleration];
  const double corner_m = CornerAheadM(foot);
  if (corner_m < 0) {
    const bool hard = braking > config_.hard_mps2 && speed < config_.hard_below_mps;
    return hard ? config_.hard_share : config_.stays_share;
  }
  const double over = speed * speed - config_.corner_mps * config_.corner_mps;
  if (over <= 0) return config_.slow_share;
  const double needed = over / (2 * std::max(1.0, corner_m));
  if (needed > config_.max_braking_mps2) return 0.02;
  const bool for_corner = braking > config_.braking_mps2 && needed > 0.4 * config_.max_braking_mps2;
  return for_corner ? config_.braking_share : config_.corner_share;
}

TrailWay::Relation TrailWay::RelationOf(const std::deque<DrivenPlace>& driven,
                                        const CourseFilter& filter, double variance_m2) const {
  Relation relation;
  if (driven.empty()) return relation;
  const double across_m2 = variance_m2 + config_.place_sigma_m * config_.place_sigma_m +
                           config_.lane_sigma_m * config_.lane_sigma_m;
  const double course_rad2 = filter.covariance()(CourseFilter::kCourse, CourseFilter::kCourse) +
                             config_.course_sigma_rad * config_.course_sigma_rad;
  const auto foot = FootOf(driven.back(), across_m2, course_rad2);
  if (!foot) return relation;
  double log_odds = foot->log_odds;
  // Where it was before, as far as the trail tells of that.
  for (auto earlier = driven.rbegin(); earlier != driven.rend(); ++earlier) {
    if ((earlier->place_m - driven.back().place_m).norm() < config_.earlier_m) continue;
    const auto before = FootOf(*earlier, across_m2, course_rad2);
    if (before && (before->segment > 0 || before->share > 0)) log_odds += before->log_odds;
    break;
  }
  relation.on = 1 / (1 + std::exp(-log_odds));
  relation.beside = foot->beside && relation.on < 0.3;
  relation.way_m = WayM(*foot);
  relation.follows = Follows(*foot, filter);
  return relation;
}

TrailWays SplitTrail(const std::vector<Eigen::Vector2d>& trail_m, const Eigen::Vector2d& hazard_m) {
  TrailWays ways;
  std::size_t segment = 0;
  Eigen::Vector2d foot_m = trail_m.front();
  ways.off_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < trail_m.size(); ++i) {
    const Eigen::Vector2d way = trail_m[i + 1] - trail_m[i];
    const double square = way.squaredNorm();
    if (square < kShortestM * kShortestM) continue;
    const double share = std::clamp(way.dot(hazard_m - trail_m[i]) / square, 0.0, 1.0);
    const Eigen::Vector2d place_m = trail_m[i] + share * way;
    const double off_m = (hazard_m - place_m).norm();
    if (off_m >= ways.off_m) continue;
    ways.off_m = off_m;
    ways.course_rad = CourseAlong(way);
    foot_m = place_m;
    segment = i;
  }
  const auto cut = trail_m.begin() + static_cast<std::ptrdiff_t>(segment) + 1;
  ways.as_it_came_m.assign(trail_m.begin(), cut);
  ways.as_it_came_m.push_back(foot_m);
  ways.as_it_went_m.assign(trail_m.rbegin(), std::make_reverse_iterator(cut));
  ways.as_it_went_m.push_back(foot_m);
  return ways;
}

double TrailEvidence(const TrailWay::Config& config, double trail_course_rad, double way_course_rad,
                     bool beside) {
  const auto density = [&](double course_rad) {
    const double off =
        std::remainder(trail_course_rad - course_rad, 2 * M_PI) / config.direction_sigma_rad;
    return std::sqrt(2 * M_PI) / config.direction_sigma_rad * std::exp(-0.5 * off * off);
  };
  const double along = density(way_course_rad);
  const double against = density(way_course_rad + M_PI);
  const double here = beside ? config.elsewhere_share : 1;
  const double own = here * (config.along_share * along + config.against_share * against) + 1 -
                     config.along_share - config.against_share;
  const double other = config.beside_share * (along + against) + 1 - 2 * config.beside_share;
  return own / other;
}

}  // namespace livemap::vehicle
