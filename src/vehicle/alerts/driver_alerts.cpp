#include "vehicle/alerts/driver_alerts.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "common/error.h"
#include "common/time.h"
#include "protocol/notice.h"

namespace livemap::vehicle {
namespace {

constexpr double kMaxFrameM = 5000;   // Further from its datum the plane begins anew.
constexpr double kPassedM = 1;        // So far behind a hazard is passed.
constexpr double kPassedAsideM = 12;  // Further aside it was never reached.
constexpr double kNoChoice = 0.985;   // Probability of a way without a junction.
constexpr std::size_t kMaxClassBytes = 256;

/// The worst first: by rank, then the sooner, then by id, so that the order is always the same.
bool IsWorse(const HazardAlert& a, const HazardAlert& b) {
  return std::tie(a.urgency, a.time_s, a.id) < std::tie(b.urgency, b.time_s, b.id);
}

void CheckPositive(const char* name, double value) {
  if (std::isfinite(value) && value > 0) return;
  throw Error("the driver alerts' " + std::string(name) + " is " + std::to_string(value) +
              ", accepted is more than 0");
}

}  // namespace

DriverAlerts::DriverAlerts(const Config& config, const protocol::HazardCatalogue& catalogue,
                           std::shared_ptr<const streets::StreetMap> map)
    : config_(config),
      catalogue_(catalogue),
      filter_(config.course),
      grid_(geo::SpatialGrid::ForRadius(config.max_reach_m)) {
  CheckPositive("least lead in seconds", config.min_lead_s);
  CheckPositive("braking in m/s^2", config.braking_mps2);
  CheckPositive("reach in metres", config.max_reach_m);
  CheckPositive("step of the way in metres", config.way.step_m);
  CheckPositive("spacing of bends in metres", config.way.bend_spacing_m);
  CheckPositive("other roads' hazards per metre", config.way.others_per_m);
  CheckPositive("noise of a fix in metres", config.course.fix_noise_m);
  if (map) street_way_.emplace(std::move(map), config.streets);
}

bool DriverAlerts::Put(const AlertHazard& hazard) {
  const bool valid = !hazard.id.IsNil() && geo::IsValid(hazard.position) &&
                     std::isfinite(hazard.sigma_m) && hazard.sigma_m >= 0 &&
                     hazard.class_name.size() <= kMaxClassBytes &&
                     (!hazard.altitude_m || std::isfinite(*hazard.altitude_m)) &&
                     protocol::IsCourseOfPass(hazard.course_rad);
  if (!valid) {
    ++counters_.invalid_hazards;
    return false;
  }
  const int urgency = catalogue_.Get(hazard.class_name).urgency;
  const auto found = numbers_.find(hazard.id);
  if (found != numbers_.end()) {
    Known& known = known_[found->second];
    grid_.Move(known.hazard.position, hazard.position, found->second);
    known = {hazard, urgency};
    known.hazard.trails = protocol::ValidTrails(hazard.trails, hazard.position);
    return true;
  }
  if (numbers_.size() >= config_.max_hazards) {
    ++counters_.refused_full;
    return false;
  }
  std::uint64_t number = known_.size();
  if (free_numbers_.empty()) {
    known_.push_back({hazard, urgency});
  } else {
    number = free_numbers_.back();
    free_numbers_.pop_back();
    known_[number] = {hazard, urgency};
  }
  known_[number].hazard.trails = protocol::ValidTrails(hazard.trails, hazard.position);
  grid_.Insert(hazard.position, number);
  numbers_.emplace(hazard.id, number);
  return true;
}

std::vector<HazardAlert> DriverAlerts::Remove(const Uuid& id) {
  std::vector<HazardAlert> told;
  const auto found = numbers_.find(id);
  if (found == numbers_.end()) return told;
  const std::uint64_t number = found->second;
  grid_.Erase(known_[number].hazard.position, number);
  free_numbers_.push_back(number);
  numbers_.erase(found);
  const auto near = near_.find(number);
  if (near == near_.end()) return told;
  if (near->second.told && !near->second.done) {
    End(HazardAlert::State::kCancelled, near->second, told);
  }
  near_.erase(near);
  return told;
}

std::vector<HazardAlert> DriverAlerts::StartAnew() {
  std::vector<HazardAlert> told;
  ForgetFar({}, told);
  filter_.Reset();
  driven_.clear();
  if (street_way_) street_way_->Reset();
  frame_.reset();
  newest_ns_.reset();
  velocity_.reset();
  std::sort(told.begin(), told.end(), IsWorse);
  return told;
}

double DriverAlerts::LeadS(int urgency, double speed_mps) const {
  const double stopping_s = config_.reaction_s + speed_mps / (2 * config_.braking_mps2);
  return std::max(config_.min_lead_s, stopping_s) + (urgency <= 1 ? config_.urgent_extra_s : 0);
}

/// Keeps where the vehicle drove just now, for the trails.
void DriverAlerts::Remember() {
  constexpr double kApartM = 3;
  constexpr std::size_t kMost = 30;
  const DrivenPlace now{filter_.state().head<2>(), filter_.state()[CourseFilter::kCourse]};
  const bool moved =
      driven_.size() < 2 || (now.place_m - driven_[driven_.size() - 2].place_m).norm() > kApartM;
  if (moved) {
    driven_.push_back(now);
  } else {
    driven_.back() = now;
  }
  if (driven_.size() > kMost) driven_.pop_front();
}

/// A plane whose datum is near the vehicle.
void DriverAlerts::FollowVehicle(const geo::GeoPoint& position) {
  if (!frame_) {
    frame_.emplace(position);
    return;
  }
  const Eigen::Vector2d place_m = frame_->ToEnu(position);
  if (place_m.norm() <= kMaxFrameM) return;
  frame_.emplace(position);
  if (place_m.norm() > 2 * kMaxFrameM) {
    filter_.Reset();
    driven_.clear();
  } else {
    filter_.MoveOrigin(place_m);
    for (DrivenPlace& driven : driven_) driven.place_m -= place_m;
  }
}

/// How far the vehicle comes in a time: its acceleration fades, and it does not drive backwards.
double DriverAlerts::ReachM(double time_s, bool may_start) const {
  const double speed = filter_.state()[CourseFilter::kSpeed];
  double push = filter_.state()[CourseFilter::kAcceleration];
  if (may_start && speed < config_.starting_speed_mps) push = std::max(push, config_.starting_mps2);
  const double fading_s = config_.course.acceleration_time_s;
  const double fade = fading_s * (1 - std::exp(-time_s / fading_s));
  const double reach_m = speed * time_s + push * fading_s * (time_s - fade);
  // A vehicle that brakes may go on after all.
  return std::max({0.0, reach_m, 0.5 * speed * time_s});
}

/// The same where the street is known: behind a bend that it slowed down for, the vehicle will
/// drive as fast as before.
double DriverAlerts::ReachOnStreetM(double time_s) const {
  const double speed = filter_.state()[CourseFilter::kSpeed];
  const double faster = std::max(0.0, street_way_->usual_mps() - speed);
  const double push = config_.speeding_up_mps2;
  const double pushing_s = std::min(time_s, faster / push);
  return speed * time_s + push * pushing_s * (time_s - 0.5 * pushing_s);
}

bool DriverAlerts::OnOtherLevel(const AlertHazard& hazard, std::optional<double> altitude_m) const {
  return hazard.altitude_m && altitude_m && std::isfinite(*altitude_m) &&
         std::abs(*hazard.altitude_m - *altitude_m) > config_.max_altitude_difference_m;
}

/// By the ways on which others came to the hazard, and where the vehicle is on none of them, by the
/// course.
void DriverAlerts::WeighTrails(const AlertHazard& hazard, const Eigen::Vector2d& place_m,
                               double fix_variance_m2, WayAhead::Relation& relation,
                               Near& near) const {
  near.on_way = false;
  TrailWay::Relation best;
  double most = 1;
  double least = 1;
  for (const protocol::Trail& trail : hazard.trails) {
    std::vector<Eigen::Vector2d> trail_m;
    for (const geo::GeoPoint& place : trail) trail_m.push_back(frame_->ToEnu(place));
    const TrailWays ways = SplitTrail(trail_m, place_m);
    bool beside = false;
    for (const auto& way_m : {ways.as_it_came_m, ways.as_it_went_m}) {
      const TrailWay::Relation way =
          TrailWay(config_.trails, way_m).RelationOf(driven_, filter_, fix_variance_m2);
      beside = beside || way.beside;
      if (way.on * way.follows >= best.on * best.follows) best = way;
    }
    const double evidence =
        TrailEvidence(config_.trails, ways.course_rad, relation.course_rad, beside);
    most = std::max(most, evidence);
    least = std::min(least, evidence);
  }
  const double own = relation.probability * most * least;
  const double corridor = relation.ahead ? own / (own + 1 - relation.probability) : 0;
  const double by_trail = best.on * best.follows;
  // Who is on no such way, or leaves it, may come to the hazard all the same.
  const double by_course = (1 - by_trail) * corridor;
  if (by_trail > by_course) {
    relation.ahead = true;
    relation.way_m = best.way_m;
    near.on_way = by_trail > 0.9;
  }
  relation.probability = by_trail + by_course;
}

/// By the streets as far as they are known and driven, else by the course.
WayAhead::Relation DriverAlerts::RelationOf(const WayAhead& way, const Known& known,
                                            double fix_variance_m2, Near& near) const {
  const double sigma_m = known.hazard.sigma_m > 0 ? known.hazard.sigma_m : config_.default_sigma_m;
  const Eigen::Vector2d place_m = frame_->ToEnu(known.hazard.position);
  WayAhead::Relation relation = way.RelationOf(place_m, sigma_m * sigma_m + fix_variance_m2);
  WeighTrails(known.hazard, place_m, fix_variance_m2, relation, near);
  if (!street_way_) return relation;
  const StreetWay::Relation street =
      street_way_->RelationOf(place_m, sigma_m * sigma_m, known.hazard.course_rad);
  // The map may lack the vehicle's carriageway, but have the opposite one.
  const double others = (1 - relation.probability) * street.against / config_.way.others_per_m;
  const double by_course = street.unknown * relation.probability / (1 + others);
  if (street.ahead && street.probability >= by_course) {
    relation.ahead = true;
    relation.way_m = street.way_m;
    relation.left_m = street.left_m;
  }
  relation.probability = street.probability + by_course;
  near.on_way = near.on_way || street.path > kNoChoice;
  near.unsure = street.path > 0 && street.path < config_.sure_above;
  return relation;
}

std::vector<HazardAlert> DriverAlerts::Add(std::int64_t stamp_ns, const geo::TrackPose& pose,
                                           bool course_is_measured,
                                           std::optional<double> altitude_m) {
  std::vector<HazardAlert> told;
  const double sigma_m = std::sqrt(pose.covariance_m2.trace() / 2);
  if (!geo::IsValid(pose.position) || !std::isfinite(sigma_m)) {
    ++counters_.invalid_positions;
    return told;
  }
  FollowVehicle(pose.position);
  CourseFilter::Sample sample;
  sample.stamp_ns = stamp_ns;
  sample.place_m = frame_->ToEnu(pose.position);
  sample.stated_sigma_m = sigma_m;
  if (course_is_measured && std::isfinite(pose.course_rad)) {
    sample.course_rad = pose.course_rad;
    sample.course_variance_rad2 = pose.course_variance_rad2;
  }
  if (!filter_.Add(sample)) {
    ++counters_.invalid_positions;
    return told;
  }
  ++counters_.positions;
  const double time_s = newest_ns_ ? Seconds(stamp_ns - *newest_ns_) : 0;
  newest_ns_ = stamp_ns;
  if (velocity_ && velocity_->first == stamp_ns && filter_.AddVelocity(velocity_->second)) {
    ++counters_.velocities;
  }
  if (street_way_) street_way_->Add(pose.position, sigma_m, filter_);
  if (!filter_.known()) return told;
  Remember();

  const double speed = filter_.state()[CourseFilter::kSpeed];
  const double longest_s = LeadS(1, speed) + filter_.period_s();
  const double longest_m =
      std::max(ReachM(longest_s), street_way_ ? ReachOnStreetM(longest_s) : 0.0);
  const double reach_m = std::min(config_.max_reach_m, 1.3 * longest_m + 20);
  const WayAhead way(config_.way, filter_, reach_m);
  if (street_way_) street_way_->LookAhead(*frame_, filter_, reach_m);
  const double radius_m = std::max(reach_m, config_.forget_beyond_m);
  std::unordered_set<std::uint64_t> seen;
  for (const auto& neighbour : grid_.Within(pose.position, radius_m)) {
    seen.insert(neighbour.id);
    const Known& known = known_[neighbour.id];
    auto near = near_.find(neighbour.id);
    if (near == near_.end()) {
      if (near_.size() >= config_.max_near) continue;
      near = near_.emplace(neighbour.id, Near{}).first;
    }
    WayAhead::Relation relation = RelationOf(way, known, sigma_m * sigma_m, near->second);
    if (OnOtherLevel(known.hazard, altitude_m)) relation.probability = 0;
    Judge(known, relation, time_s, near->second, told);
  }
  ForgetFar(seen, told);
  std::sort(told.begin(), told.end(), [](const HazardAlert& a, const HazardAlert& b) {
    const bool a_begins = a.state == HazardAlert::State::kApproach;
    const bool b_begins = b.state == HazardAlert::State::kApproach;
    return a_begins != b_begins ? b_begins : IsWorse(a, b);
  });
  return told;
}

bool DriverAlerts::AddVelocity(std::int64_t stamp_ns, const CourseFilter::Velocity& velocity) {
  if (!velocity.plane_mps.allFinite() || !std::isfinite(velocity.stated_sigma_mps)) return false;
  if (newest_ns_ != stamp_ns) {
    velocity_.emplace(stamp_ns, velocity);
  } else if (filter_.AddVelocity(velocity)) {
    ++counters_.velocities;
  }
  return true;
}

/// What the vehicle has left far behind may be approached anew.
void DriverAlerts::ForgetFar(const std::unordered_set<std::uint64_t>& seen,
                             std::vector<HazardAlert>& told) {
  for (auto near = near_.begin(); near != near_.end();) {
    if (seen.count(near->first) != 0) {
      ++near;
      continue;
    }
    if (near->second.told && !near->second.done) {
      End(HazardAlert::State::kCancelled, near->second, told);
    }
    near = near_.erase(near);
  }
}

/// Whether the driver must be told now: at the next position it would be too late.
bool DriverAlerts::IsDue(const Near& near) const {
  const double speed = filter_.state()[CourseFilter::kSpeed];
  const double course_variance = filter_.covariance()(CourseFilter::kCourse, CourseFilter::kCourse);
  const double max_sigma = config_.max_course_sigma_rad;
  if (speed < config_.min_speed_mps || course_variance > max_sigma * max_sigma) return false;
  const bool late = near.unsure && near.alert.time_s < config_.late_s;
  const double above = late          ? config_.late_above
                       : near.unsure ? config_.unsure_above
                                     : config_.alert_above;
  const double probability = near.alert.probability;
  if (probability < above) return false;
  if (probability < config_.at_once_above && *near.likely < above) return false;
  const double lead_s = LeadS(near.alert.urgency, speed);
  const double wait_s =
      (near.unsure ? std::min(lead_s, config_.unsure_lead_s) : lead_s) + filter_.period_s();
  // Before a junction, who brakes is not taken to speed up again at once: waiting tells whether the
  // vehicle turns. Where the way is clear all the same, the driver is told before it stops.
  const bool brakes =
      filter_.state()[CourseFilter::kAcceleration] < -config_.brakes_from_mps2 && near.unsure;
  double reach_m = ReachM(wait_s, !brakes || probability >= config_.at_once_above);
  if ((near.unsure || near.on_way) && !brakes) {
    reach_m = std::max(reach_m, ReachOnStreetM(wait_s));
  }
  return near.alert.distance_m <= reach_m;
}

void DriverAlerts::Judge(const Known& known, const WayAhead::Relation& relation, double time_s,
                         Near& near, std::vector<HazardAlert>& told) {
  if (near.done) return;
  near.alert.id = known.hazard.id;
  near.alert.class_name = known.hazard.class_name;
  near.alert.urgency = known.urgency;
  const double fresh = near.likely ? 1 - std::exp(-time_s / config_.sure_time_s) : 1;
  near.likely = near.likely.value_or(0) + fresh * (relation.probability - near.likely.value_or(0));
  if (!relation.ahead) {
    near.alert.probability = 0;
    if (!near.told) return;
    if (relation.forward_m < -kPassedM) {
      End(std::abs(relation.left_m) < kPassedAsideM ? HazardAlert::State::kPassed
                                                    : HazardAlert::State::kCancelled,
          near, told);
    }
    return;
  }
  const double speed = std::max(0.5, filter_.state()[CourseFilter::kSpeed]);
  near.alert.distance_m = std::max(0.0, relation.way_m);
  near.alert.time_s = near.alert.distance_m / speed;
  near.alert.probability = relation.probability;
  near.alert.side = std::abs(relation.left_m) <= config_.side_from_m ? HazardAlert::Side::kAhead
                    : relation.left_m > 0                            ? HazardAlert::Side::kLeft
                                                                     : HazardAlert::Side::kRight;
  if (!near.told) {
    if (!IsDue(near)) return;
    near.told = true;
    near.alert.state = HazardAlert::State::kApproach;
    ++counters_.approaches;
    told.push_back(near.alert);
    return;
  }
  const bool stands = filter_.state()[CourseFilter::kSpeed] < config_.min_speed_mps;
  if (stands) return;
  near.unlikely_s = relation.probability < config_.cancel_below ? near.unlikely_s + time_s : 0;
  if (near.unlikely_s >= config_.cancel_after_s) End(HazardAlert::State::kCancelled, near, told);
}

void DriverAlerts::End(HazardAlert::State state, Near& near, std::vector<HazardAlert>& told) {
  near.done = true;
  near.alert.state = state;
  near.alert.distance_m = 0;
  near.alert.time_s = 0;
  near.alert.probability = 0;
  ++(state == HazardAlert::State::kPassed ? counters_.passed : counters_.cancelled);
  told.push_back(near.alert);
}

std::vector<HazardAlert> DriverAlerts::Ahead() const {
  std::vector<HazardAlert> ahead;
  for (const auto& [number, near] : near_) {
    if (near.told && !near.done) ahead.push_back(near.alert);
  }
  std::sort(ahead.begin(), ahead.end(), IsWorse);
  return ahead;
}

}  // namespace livemap::vehicle
