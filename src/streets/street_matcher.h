#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "geo/wgs84.h"
#include "streets/street_map.h"

namespace livemap::streets {

/// One place on the streets where the vehicle may be.
struct StreetMatch {
  Travel travel;           ///< The segment and the direction in which it drives there.
  double along_m = 0;      ///< From the travel's start.
  double left_m = 0;       ///< Of the segment, as the position says.
  double probability = 0;  ///< That the vehicle is there.
};

/// Says on which street a vehicle drives, from one position after the other: a hidden Markov model
/// whose states are the places on streets near the position, and one state for no street at all.
/// Source: P. Newson, J. Krumm, "Hidden Markov map matching through noise and sparseness", ACM
/// SIGSPATIAL GIS 2009; here with the course, and filtered (forward) instead of by the best whole
/// path, because the answer is wanted at once. docs/explanation/driver-alerts.md has the equations.
/// Bounded: a position costs at most max_states times max_reached steps. Deterministic. Not
/// thread-safe.
class StreetMatcher {
 public:
  struct Config {
    double radius_m = 30;            ///< Streets further away are not looked at, beside 3 sigma, m.
    double map_sigma_m = 1.5;        ///< Of the map's nodes, per axis, m.
    double street_sigma_m = 2.0;     ///< Of vehicles beside the line that the map has, m.
    double course_sigma_rad = 0.3;   ///< Between course and street, beside the course's own.
    double wrong_course = 0.02;      ///< Share of positions whose course says nothing.
    double detour_m = 4;             ///< Mean difference of way on the map and in the air, m.
    double off_street_sigmas = 3.0;  ///< So far off a street and none are equally likely.
    double leaves_streets = 0.002;   ///< Probability per position.
    double enters_streets = 0.05;    ///< The same, to each place near.
    double turns_back = 0.0002;      ///< The same, of turning on the spot.
    double min_move_m = 1.0;         ///< Nearer to the last one a position is not used, m.
    double independent_m = 8;        ///< Errors of positions so far apart are others, m.
    double min_course_speed_mps = 1.5;  ///< The course of a slower vehicle is not used.
    double max_gap_m = 300;             ///< After a longer way between positions it begins anew.
    std::size_t max_states = 64;        ///< Kept, the likeliest.
    std::size_t max_reached = 256;      ///< Segments looked at from one state.
  };

  /// What is known of the vehicle at one moment.
  struct Position {
    geo::GeoPoint place;
    double sigma_m = 0;                ///< Per axis.
    std::optional<double> course_rad;  ///< Clockwise from north.
    double course_sigma_rad = 0;
    double speed_mps = 0;
  };

  /// Throws Error for a config that cannot be; `map` must not be null.
  StreetMatcher(std::shared_ptr<const StreetMap> map, const Config& config);

  /// Takes in a position; one that is not finite is refused: false.
  bool Add(const Position& position);
  /// Forgets the positions.
  void Reset();

  /// Where the vehicle may be, the likeliest first. The probabilities add up to at most 1: the rest
  /// is no street of the map.
  const std::vector<StreetMatch>& matches() const { return matches_; }
  /// That the vehicle is on a street of the map.
  double on_street() const { return 1 - off_street_; }
  /// Where it was when the matches were made.
  const std::optional<Position>& matched_at() const { return last_; }
  const StreetMap& map() const { return *map_; }

 private:
  struct Reached {
    Travel travel;
    double way_m;  // From the state to the travel's start.
  };

  std::vector<StreetMatch> PlacesNear(const Position& position) const;
  double EmissionOf(const StreetMatch& place, double street_course_rad,
                    const Position& position) const;
  std::vector<Reached> ReachedFrom(const StreetMatch& state, double most_m) const;
  void Begin(std::vector<StreetMatch> places);
  void Step(std::vector<StreetMatch> places, double moved_m);
  void Keep(std::vector<StreetMatch> places, double off);
  double LengthM(std::uint32_t segment) const;

  std::shared_ptr<const StreetMap> map_;
  Config config_;
  std::optional<Position> last_;
  std::vector<StreetMatch> matches_;
  double off_street_ = 1;
};

}  // namespace livemap::streets
