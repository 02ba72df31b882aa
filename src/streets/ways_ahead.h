#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "geo/wgs84.h"
#include "streets/street_map.h"
#include "streets/street_matcher.h"
#include "streets/turn_choice.h"

namespace livemap::streets {

/// How the vehicle drives now, for the choice at junctions.
struct Driving {
  double speed_mps = 0;
  double push_mps2 = 0;   ///< Acceleration.
  double usual_mps = 0;   ///< Speed before it began to brake.
  double course_rad = 0;  ///< Clockwise from north.
  double course_sigma_rad = 0;
  bool course_known = false;
  double turn_habit = 1;  ///< Of the driver; TurnHabit has it.
  /// Towards or in a junction: the street by which the vehicle comes to it.
  std::optional<Travel> approach;
  /// In a roundabout: the node of the ring at which the vehicle came in.
  std::optional<std::uint32_t> ring_entry;
};

/// A piece of the ways that a vehicle may drive.
struct Leg {
  Travel travel;
  int before = -1;         ///< Number of the leg from which it comes; -1: the vehicle is on it.
  Eigen::Vector2d from_m;  ///< Where it begins, east and north.
  Eigen::Vector2d to_m;    ///< Where it ends.
  double start_m = 0;      ///< Way from the vehicle to its begin; negative where it is on it.
  double probability = 0;  ///< That the vehicle drives it.
  double ends = 0;         ///< That the vehicle's way, as far as it is told, ends with it.
  bool open = false;       ///< It ends before the way that was asked for: what follows, where
                           ///< the vehicle drives on, is not known.

  double length_m() const { return (to_m - from_m).norm(); }
};

/// What a vehicle can reach ahead on the streets, within a way: the tree of legal ways on, with the
/// probability of each. Legs stand after those from which they come.
class WaysAhead {
 public:
  struct Config {
    std::size_t max_legs = 600;       ///< Beyond it the ways end early.
    double least_probability = 0.01;  ///< Less likely ways are left out.
    double angle_way_m = 14;          ///< Angles at junctions are taken over this way, m.
    double junction_m = 18;           ///< So far from its node a vehicle is in a junction, m.
    TurnConfig turns;
  };

  /// From where the vehicle may be (StreetMatcher::matches), `way_m` metres on. Places are on the
  /// plane of `frame`.
  WaysAhead(const Config& config, const StreetMap& map, const std::vector<StreetMatch>& matches,
            const geo::LocalFrame& frame, const Driving& driving, double way_m);

  const std::vector<Leg>& legs() const { return legs_; }
  /// Whether a street is one of the legs, or joins one of them at a node.
  bool Touches(std::uint32_t segment) const;

 private:
  std::optional<double> InJunctionM(const StreetMatch& match) const;
  void Extend(std::size_t number, double way_m);
  TurnOption OptionOf(const Leg& leg, const Travel& next) const;
  const Leg& RootOf(const Leg& leg) const;
  std::optional<std::uint32_t> RingEntryOf(const Leg& leg) const;
  int ExitsLeft(const Leg& leg, std::uint32_t entry) const;
  std::vector<double> SharesOf(const Leg& leg, const std::vector<Travel>& onwards) const;
  Eigen::Vector2d PlaceOf(std::uint32_t node) const;
  Eigen::Vector2d DirectionAfter(Travel travel) const;
  void Add(const Travel& travel, int before, double start_m, double probability);

  const Config& config_;
  const StreetMap& map_;
  const geo::LocalFrame& frame_;
  Driving driving_;
  std::vector<Leg> legs_;
  std::vector<std::uint32_t> nodes_;  // Of the legs, sorted.
};

}  // namespace livemap::streets
