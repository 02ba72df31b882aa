#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "geo/wgs84.h"
#include "streets/street_map.h"
#include "streets/street_matcher.h"
#include "streets/turn_habit.h"
#include "streets/ways_ahead.h"
#include "vehicle/alerts/course_filter.h"

namespace livemap::vehicle {

/// The way that a vehicle will probably drive, by the streets of a map: it is matched to them, and
/// their geometry ahead, with the choices at junctions, says which places lie on its way.
///
/// A place that lies d beside the middle of a carriageway belongs to it by the density of d,
/// against a density of what the map does not have, and against streets that do not meet the way
/// there: a bridge above it, a parallel street. docs/explanation/driver-alerts.md has the
/// equations. Deterministic. Not thread-safe.
class StreetWay {
 public:
  struct Config {
    double map_sigma_m = 1.2;     ///< Of the map's lines, to the side, m.
    double others_per_m = 0.002;  ///< Hazards that lie on no street of the map, as in WayAhead.
    /// Weight of a street on another level against the way's own: more than 1 rather keeps silent
    /// where a place may lie on either.
    double other_level_weight = 1.5;
    /// Standard deviation of the course of who passed a place, against its street, rad.
    double passed_sigma_rad = 0.25;
    double passed_wrong = 0.1;    ///< Share of such courses that say nothing of the street.
    double bend_from_mps = 3;     ///< A slower vehicle's course does not tell where it turns.
    double usual_way_m = 400;     ///< Way over which the usual speed is forgotten, m.
    double matched_fraction = 1;  ///< Of the fix's stated sigma that the matcher believes.
    streets::StreetMatcher::Config matcher;
    streets::WaysAhead::Config ways;
    streets::TurnHabit::Config habit;
  };

  /// How a place lies to the streets ahead.
  struct Relation {
    bool ahead = false;      ///< On a way ahead; else nothing but `unknown` and `against` is set.
    double way_m = 0;        ///< Along that way.
    double left_m = 0;       ///< Of the middle of its carriageway.
    double probability = 0;  ///< That it lies on the vehicle's way and that way on the streets.
    double path = 0;         ///< That the vehicle's way leads there at all.
    double unknown = 1;      ///< That the vehicle's way there does not follow the map.
    /// Density of one-way streets against the vehicle's course, on which it cannot be, 1/m.
    double against = 0;
  };

  /// `map` must not be null. Throws Error for a config that cannot be.
  StreetWay(std::shared_ptr<const streets::StreetMap> map, const Config& config);

  /// Takes in a position with its standard deviation per axis, and what the filter knows of it.
  void Add(const geo::GeoPoint& position, double sigma_m, const CourseFilter& filter);
  /// Forgets the positions.
  void Reset();
  /// Looks `way_m` metres ahead. Places are on the plane of `frame`, which has to stay until the
  /// next call.
  void LookAhead(const geo::LocalFrame& frame, const CourseFilter& filter, double way_m);
  /// Of a place on the plane of the last LookAhead; `variance_m2` is of the place, per axis.
  /// `passed_rad` is the course of a vehicle that passed it, clockwise from north; NaN: not known.
  Relation RelationOf(const Eigen::Vector2d& place_m, double variance_m2, double passed_rad) const;

  /// That the vehicle is on a street of the map.
  double on_street() const { return matcher_.on_street(); }
  /// Speed on the way until here, before the vehicle began to brake, m/s.
  double usual_mps() const { return usual_mps_; }
  /// The driver's odds to turn at a junction, as streets::TurnHabit has them.
  double turn_habit() const { return habit_.factor(); }
  const streets::StreetMatcher& matcher() const { return matcher_; }

 private:
  /// A piece of a street.
  struct Other {
    Eigen::Vector2d from_m, to_m;
    double half_width_m;
    int layer;
    bool meets;    // The way, at a node.
    bool against;  // It is a one-way street against the vehicle's course.
    bool one_way;  // From its begin to its end.
  };
  /// One near a place, with the density that it has there.
  struct OtherNear {
    Eigen::Vector2d along;  // From its begin to its end.
    int layer;
    bool meets;
    bool against;
    double density;
    double passed;  // PassedDensity of it.
  };

  void FollowJunction();
  void NotePassed(const streets::Travel& approach, const streets::Travel& now);
  double AngleRad(const streets::Travel& from, const streets::Travel& onto) const;
  std::optional<std::uint32_t> RingEntryAhead() const;
  double Density(double off_m, double half_width_m, double variance_m2) const;
  double PassedDensity(const Eigen::Vector2d& along, bool one_way, double passed_rad) const;
  std::vector<OtherNear> OthersNear(const Eigen::Vector2d& place_m, double variance_m2,
                                    double passed_rad) const;
  double OtherDensity(const std::vector<OtherNear>& others, double own, double own_passed,
                      const streets::Leg& leg) const;

  std::shared_ptr<const streets::StreetMap> map_;
  Config config_;
  streets::StreetMatcher matcher_;
  double usual_mps_ = 0;
  std::optional<geo::GeoPoint> last_;
  streets::TurnHabit habit_;
  std::optional<streets::Travel> approach_;  // To the junction that the vehicle comes to or is in.
  std::optional<std::uint32_t> ring_entry_;  // Node at which it came into a roundabout.
  std::vector<streets::Leg> legs_;
  std::vector<Other> others_;  // All streets near, the way's own, too.
};

}  // namespace livemap::vehicle
