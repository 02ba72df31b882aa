#include "streets/turn_choice.h"

#include <algorithm>
#include <cmath>

namespace livemap::streets {
namespace {

constexpr double kLeastShare = 0.03;   // Of what the angles say, whatever the speed tells.
constexpr double kSlowShare = 0.65;    // Of the usual speed: clearly slower.
constexpr double kStopsShare = 0.75;   // Of a turn's speed: slower than any turn needs.
constexpr double kBendFromM = 20;      // So near the junction the course tells the side.
constexpr double kLeastBend = 0.02;    // Density of any course, whatever way is driven.
constexpr double kSharpestRad = 2.6;   // Sharper turns are driven as this one.
constexpr double kTurnEnds = 0.3;      // Of its begin before the node: there the wheel is let go.
constexpr double kSpeedsUpMps2 = 2.2;  // Behind a turn.

double NormalShareBelow(double value) { return 0.5 * std::erfc(-value / std::sqrt(2)); }

/// Radius and begin of a turn that is driven from one street into the other.
struct Corner {
  double speed_mps;
  double begins_m;  // Before the node.
};

Corner CornerOf(const TurnConfig& config, double angle_rad) {
  const double half = std::tan(0.5 * std::min(std::abs(angle_rad), kSharpestRad));
  const double radius_m = std::clamp(config.corner_m / std::max(half, 0.01), 5.0, 200.0);
  return {std::sqrt(config.sideways_mps2 * radius_m), std::min(radius_m * half, 12.0)};
}

/// Share of braking vehicles among those whose acceleration is measured so, which is uncertain.
double BrakingShare(const TurnConfig& config, double push_mps2) {
  return NormalShareBelow((-push_mps2 - config.brakes_from_mps2) / config.push_sigma_mps2);
}

/// Likelihood of the speed and its change, where the vehicle will go straight on.
double SpeedStraight(const TurnConfig& config, const Approach& approach, double corner_mps) {
  // It stops, which says little of where it drives afterwards.
  const bool slowed = approach.speed_mps < kSlowShare * approach.usual_mps;
  if (approach.speed_mps < kStopsShare * corner_mps) return slowed ? config.stops_without_turn : 1;
  const double brakes = BrakingShare(config, approach.push_mps2);
  const double speeds_up = BrakingShare(config, -approach.push_mps2);
  const double steady = slowed ? config.slow_without_turn : 1;
  return brakes * config.brakes_without_turn + speeds_up +
         std::max(0.0, 1 - brakes - speeds_up) * steady;
}

double SpeedTurning(const TurnConfig& config, const Approach& approach, const Corner& corner) {
  if (approach.speed_mps < kStopsShare * corner.speed_mps) return 1;
  const double to_turn_m = std::max(config.least_turn_distance_m,
                                    approach.distance_m - config.slowest_share * corner.begins_m);
  // Behind the turn it speeds up again.
  const double behind_m = std::max(0.0, -approach.distance_m - kTurnEnds * corner.begins_m);
  const double too_fast = approach.speed_mps * approach.speed_mps -
                          corner.speed_mps * corner.speed_mps - 2 * kSpeedsUpMps2 * behind_m;
  const double needed_mps2 = too_fast / (2 * to_turn_m);
  const auto share_above = [&](double mps2) {
    return NormalShareBelow((mps2 - needed_mps2) / config.braking_sigma_mps2);
  };
  // Who brakes has begun when it was time; who does not will do so.
  const double begun = std::max(1 - share_above(0.4 * config.braking_mps2), 0.2);
  const double braking = share_above(config.braking_mps2 + 1) * (too_fast < 0 ? 0.5 : begun);
  const double later = share_above(config.braking_mps2);
  const bool near = approach.distance_m < 2 * corner.begins_m;
  const double speeding_up = later * (near && too_fast > 0 ? 0.3 : 1);
  const double brakes = BrakingShare(config, approach.push_mps2);
  const double speeds_up = BrakingShare(config, -approach.push_mps2);
  return brakes * braking + speeds_up * speeding_up + std::max(0.0, 1 - brakes - speeds_up) * later;
}

double DensityOf(double value, double sigma) {
  return std::exp(-0.5 * value * value / (sigma * sigma)) / (std::sqrt(2 * M_PI) * sigma);
}

/// Likelihood of the course against the street's, near the junction: a turn is driven around the
/// node, from as far before it as behind it.
double BendLikelihood(const TurnConfig& config, const Approach& approach, double angle_rad) {
  if (!approach.bend_known || approach.distance_m > kBendFromM) return 1;
  const double begins_m = std::max(CornerOf(config, angle_rad).begins_m, 1.0);
  const double done = std::clamp(0.5 - 0.5 * approach.distance_m / begins_m, 0.0, 1.0);
  const double wander = std::hypot(config.bend_sigma_rad, approach.bend_sigma_rad);
  const double ahead_rad = approach.bend_rad - done * angle_rad;
  if (std::abs(angle_rad) < config.straight_rad) return DensityOf(ahead_rad, wander) + kLeastBend;
  // Nobody swings out to the other side, or beyond the way that is taken.
  const double off_rad = approach.bend_rad - std::clamp(approach.bend_rad, std::min(0.0, angle_rad),
                                                        std::max(0.0, angle_rad));
  const double within = std::exp(-0.5 * off_rad * off_rad / (wander * wander));
  const double by_place_rad = angle_rad * config.turn_sigma_m / (2 * begins_m);
  return within * DensityOf(ahead_rad, std::hypot(wander, by_place_rad)) + kLeastBend;
}

/// Each exit is equally likely until the vehicle would be back where it came in.
double RingShare(const TurnConfig& config, const Approach& approach, const TurnOption& option) {
  if (approach.exits_left == 0) return option.ring ? 1 : config.leaves_ring_weight;
  if (!option.ring) return 1;
  return std::max<double>(approach.exits_left - 1, config.past_entry_weight);
}

}  // namespace

std::vector<double> TurnProbabilities(const TurnConfig& config, const Approach& approach,
                                      const std::vector<TurnOption>& options) {
  std::vector<double> shares;
  double slowest_mps = 100;
  for (const TurnOption& option : options) {
    slowest_mps = std::min(slowest_mps, CornerOf(config, option.angle_rad).speed_mps);
  }
  double sum = config.unknown_weight * BendLikelihood(config, approach, 0);
  if (!approach.in_roundabout) sum *= SpeedStraight(config, approach, slowest_mps);
  for (const TurnOption& option : options) {
    const bool straight = std::abs(option.angle_rad) < config.straight_rad;
    double share = straight ? config.straight_weight : config.turn_weight * approach.turn_habit;
    if (approach.in_roundabout) share = RingShare(config, approach, option);
    if (option.same_street && !approach.in_roundabout) share *= config.same_street_weight;
    if (option.lesser) share *= config.lesser_weight;
    if (!approach.in_roundabout) {
      const double by_speed =
          straight ? SpeedStraight(config, approach, slowest_mps)
                   : SpeedTurning(config, approach, CornerOf(config, option.angle_rad));
      share *= std::max(by_speed, kLeastShare);
    }
    share *= BendLikelihood(config, approach, option.angle_rad);
    shares.push_back(share);
    sum += share;
  }
  for (double& share : shares) share /= sum;
  return shares;
}

}  // namespace livemap::streets
