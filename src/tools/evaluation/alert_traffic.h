#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "tools/evaluation/alert_streets.h"

namespace livemap::tools {

/// A hazard of simulated traffic, where it truly lies.
struct TrafficHazard {
  Eigen::Vector2d place_m;   ///< East, north.
  bool other_level = false;  ///< On a bridge above the vehicle's way.
  std::string class_name;
  /// Course of a vehicle on the hazard's lane that sees it, clockwise from north: 8 to 25 m before
  /// it, perhaps before a bend or a turn.
  double course_rad = 0;
  /// The same on the oncoming lane; NaN where the street is driven in one direction.
  double oncoming_course_rad = 0;
  /// How vehicles on its lane passed it: up to 300 m before and behind it, in driving order.
  std::vector<std::vector<Eigen::Vector2d>> trails_m{};
  /// The same on the oncoming lane; empty where the street is driven in one direction.
  std::vector<std::vector<Eigen::Vector2d>> oncoming_trails_m{};
};

/// Where the vehicle truly is at one moment.
struct TrafficMoment {
  double time_s = 0;
  double moving_s = 0;  ///< Time without the time that it stood.
  double way_m = 0;     ///< Driven until then.
  double speed_mps = 0;
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
};

/// One drive of one vehicle along a way of its own, through streets with hazards.
struct TrafficDrive {
  std::vector<Eigen::Vector2d> way_m;  ///< The middle of its lane, a point every metre.
  std::vector<TrafficMoment> moments;  ///< One every kTrafficStepS.
  std::vector<TrafficHazard> hazards;
  std::vector<TrafficStreet> streets;        ///< As a map of them would have them.
  std::vector<Eigen::Vector2d> junctions_m;  ///< Where they meet; a bridge meets nothing.
};

constexpr double kTrafficStepS = 0.1;

/// The kinds of streets: parallel, opposite, crossings, bridges, curves, roundabouts, turns, stops.
const std::vector<std::string>& TrafficScenarios();

/// Makes up streets, a drive through them, and hazards: on every lane of every street, the
/// vehicle's own or not, `per_km` of them on average, at places that do not depend on one another.
/// The same seed gives the same drive. Throws Error for a scenario that there is not.
TrafficDrive MakeTrafficDrive(const std::string& scenario, double per_km, std::uint64_t seed);

}  // namespace livemap::tools
