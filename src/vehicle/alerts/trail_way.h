#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "vehicle/alerts/course_filter.h"

namespace livemap::vehicle {

/// Where and in which direction a vehicle drove.
struct DrivenPlace {
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();  ///< East, north.
  double course_rad = 0;                              ///< Clockwise from north.
};

/// The way to a hazard by the trail of a vehicle that passed it, and whether this vehicle drives on
/// that way.
///
/// The vehicle is on the way, or somewhere else. By its places across the way and its course
/// against the way's, the former has a density, and the latter is even over places and courses.
/// Those who are on the way follow it to the hazard, but for those who turn off. At a corner of the
/// way those follow it who slow down for the corner. docs/explanation/driver-alerts.md has the
/// equations.
class TrailWay {
 public:
  struct Config {
    double place_sigma_m = 2.0;      ///< Of a trail's places, per axis, m.
    double lane_sigma_m = 1.5;       ///< Between lanes of one direction, m.
    double course_sigma_rad = 0.15;  ///< Of a trail's direction.
    double others_per_m = 0.022;     ///< Other ways per own one and metre to the side...
    double parallel_share = 0.3;  ///< ...so many of them in the trail's direction, others in any.
    double before_m = 30;         ///< So far before its first place a trail counts, m.
    double earlier_m = 30;        ///< So far back the vehicle's place counts once more, m.
    double stays_share = 0.97;    ///< Of vehicles on the way where it turns no corner.
    double corner_rad = 0.5;      ///< A turn by more within corner_way_m is a corner.
    double corner_way_m = 16;
    double corner_share = 0.3;      ///< Of the vehicles on the way that turn at a corner.
    double corner_mps = 6.5;        ///< Speed at a corner.
    double max_braking_mps2 = 3.5;  ///< Who needed more than this to turn goes straight on.
    double braking_mps2 = 0.7;      ///< From here on a vehicle brakes for the corner...
    double braking_share = 0.75;    ///< ...and so many of those turn.
    double slow_share = 0.45;       ///< Of those that are as slow before it and do not brake.
    double hard_mps2 = 1.2;         ///< Who brakes so hard where there is no corner...
    double hard_below_mps = 10;     ///< ...below this speed...
    double hard_share = 0.5;        ///< ...stays on the way with this probability.
    /// Of the trails past what lies on a way, so many lead along it, and so many against it; the
    /// others come from anywhere.
    double along_share = 0.78, against_share = 0.15;
    double beside_share = 0.25;        ///< Of those past what lies beside a way, each of both.
    double direction_sigma_rad = 0.2;  ///< Of the direction of a trail where it passes.
    double elsewhere_share = 0.05;  ///< Of the trails along a way that this vehicle does not drive.
  };

  /// How the vehicle is to the way.
  struct Relation {
    double on = 0;        ///< Probability that it drives on it.
    double follows = 0;   ///< Probability that it follows it to the hazard if it does.
    double way_m = 0;     ///< Along the way to the hazard, m.
    bool beside = false;  ///< It drives in the way's direction, but beside it.
  };

  /// The way along these places to the last one, which is beside the hazard; of at least one place.
  TrailWay(const Config& config, std::vector<Eigen::Vector2d> places_m)
      : config_(config), places_m_(std::move(places_m)) {}

  /// Of a vehicle whose places were `driven` (the last one is where it is now), on the plane of the
  /// trail. `variance_m2`: of a place per axis.
  Relation RelationOf(const std::deque<DrivenPlace>& driven, const CourseFilter& filter,
                      double variance_m2) const;

 private:
  struct Foot {
    std::size_t segment = 0;
    double share = 0;     // Of the segment; less than 0 before the trail.
    double log_odds = 0;  // Of a vehicle on the way against one anywhere.
    bool beside = false;
  };

  std::optional<Foot> FootOf(const DrivenPlace& driven, double across_m2, double course_rad2) const;
  double WayM(const Foot& foot) const;
  double CornerAheadM(const Foot& foot) const;
  double Follows(const Foot& foot, const CourseFilter& filter) const;

  Config config_;
  std::vector<Eigen::Vector2d> places_m_;
};

/// The two ways to a hazard by the trail of a vehicle that passed it: as that vehicle came, and as
/// it went on, driven the other way round.
struct TrailWays {
  std::vector<Eigen::Vector2d> as_it_came_m;
  std::vector<Eigen::Vector2d> as_it_went_m;  ///< Against the trail's direction.
  double course_rad = 0;                      ///< Of the trail beside the hazard.
  double off_m = 0;                           ///< From the hazard to the trail.
};

/// Splits a trail (places in driving order, at least two) where it is nearest to the hazard.
TrailWays SplitTrail(const std::vector<Eigen::Vector2d>& trail_m, const Eigen::Vector2d& hazard_m);

/// By how much a trail of this course beside a hazard speaks for a hazard on a way with
/// `way_course_rad`, against one beside that way. `beside`: the vehicle drives beside the trail.
double TrailEvidence(const TrailWay::Config& config, double trail_course_rad, double way_course_rad,
                     bool beside);

}  // namespace livemap::vehicle
