#pragma once

#include <vector>

namespace livemap::streets {

/// How a vehicle drives towards a junction.
struct Approach {
  double distance_m = 0;       ///< To the junction's node; negative when it is passed.
  double speed_mps = 0;        ///< Now.
  double push_mps2 = 0;        ///< Acceleration, negative where it brakes.
  double usual_mps = 0;        ///< Speed on the way until here.
  double bend_rad = 0;         ///< Its course against that of the street, to the left positive.
  double bend_sigma_rad = 0;   ///< Of bend_rad, as the course is known.
  bool bend_known = false;     ///< Whether bend_rad is known.
  bool in_roundabout = false;  ///< The street until the junction is the ring of a roundabout.
  double turn_habit = 1;       ///< Factor of the weight of turns; TurnHabit has it.
  int exits_left = 0;          ///< Of the ring until where the vehicle came in; 0: not known.
};

/// One way on at a junction.
struct TurnOption {
  double angle_rad = 0;      ///< Of the way on against the way until here, to the left positive.
  bool same_street = false;  ///< It has the same name, or is the same way of the map.
  bool ring = false;         ///< It is the ring of a roundabout.
  bool lesser = false;       ///< It is much less important than the street until here.
};

/// The numbers of TurnProbabilities; docs/explanation/driver-alerts.md has the equations.
struct TurnConfig {
  double straight_rad = 0.6;     ///< A way on that bends less goes straight on.
  double straight_weight = 1.0;  ///< Before anything is known of how the vehicle drives.
  double turn_weight = 0.3;
  double leaves_ring_weight = 0.6;  ///< Of an exit against the ring's own 1.
  double past_entry_weight = 0.1;   ///< Of the ring behind its last exit, against that exit.
  double same_street_weight = 1.5;  ///< Factor.
  double lesser_weight = 0.4;       ///< Factor.
  double corner_m = 10;             ///< Radius of a turn by a right angle, m.
  double sideways_mps2 = 2.2;       ///< That drivers take in turns.
  /// Drivers brake into a turn: they are that slow at this share of its begin before the node.
  double slowest_share = 0.7;
  double least_turn_distance_m = 3;   ///< To where they are, m.
  double braking_mps2 = 2.5;          ///< How drivers brake before turns, mean...
  double braking_sigma_mps2 = 0.5;    ///< ...and standard deviation.
  double push_sigma_mps2 = 0.4;       ///< Of the measured acceleration.
  double brakes_from_mps2 = 1.0;      ///< From here on a vehicle brakes or speeds up.
  double brakes_without_turn = 0.12;  ///< Share of those who go straight on and brake so.
  double slow_without_turn = 0.25;    ///< The same, who drive much more slowly than before.
  double stops_without_turn = 0.5;    ///< The same, who drive even more slowly than turns need.
  double bend_sigma_rad = 0.1;        ///< Of the course against the street's, straight on.
  double turn_sigma_m = 5;            ///< Of the place where a turn is driven, m.
  double unknown_weight = 0.03;       ///< Of a way straight on that the map does not have.
};

/// With what probability the vehicle takes each of the ways. They add up to less than 1: the rest
/// is a way that the map does not have. By the angles, and by how it drives: who turns has to be
/// slow enough at the corner and brakes before, who does not brake in time goes straight on, and a
/// course that bends tells the side. Empty for no options.
std::vector<double> TurnProbabilities(const TurnConfig& config, const Approach& approach,
                                      const std::vector<TurnOption>& options);

}  // namespace livemap::streets
