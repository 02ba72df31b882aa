#pragma once

#include <Eigen/Core>
#include <vector>

#include "vehicle/alerts/course_filter.h"

namespace livemap::vehicle {

/// The way that a vehicle will probably drive, as a corridor: the present curvature carried on and
/// fading, with what is not known of it. It answers with what probability a place lies on that way.
///
/// A place that lies d to the side of the predicted way, s ahead, is on the vehicle's own way or on
/// some other road. The density of the own way there is a mixture: the road goes on as it does, or
/// it bends in between. The density of other roads is the same everywhere. Their ratio is the
/// probability. docs/explanation/driver-alerts.md has the equations.
class WayAhead {
 public:
  struct Config {
    double lane_sigma_m = 1.0;    ///< Where in its lane something lies, standard deviation, m.
    double bend_spacing_m = 250;  ///< Mean way between places where a road bends anew, m.
    double others_per_m = 0.022;  ///< Other roads' hazards per own one and metre to the side.
    double step_m = 3;            ///< Between two places of the prediction, m.
    double max_way_m = 400;       ///< Predicted at most, m.
  };

  /// How a place lies to the way.
  struct Relation {
    bool ahead = false;      ///< Beside the predicted way, before its end; else nothing but
                             ///< forward_m and left_m is set.
    double way_m = 0;        ///< Along the way.
    double left_m = 0;       ///< Of the way where ahead; else of the straight line ahead.
    double forward_m = 0;    ///< Along the straight line ahead, negative behind.
    double probability = 0;  ///< That it lies on the vehicle's own way.
    double course_rad = 0;   ///< Of the way beside the place, clockwise from north.
  };

  /// Predicts `way_m` metres from a filter that knows its state.
  WayAhead(const Config& config, const CourseFilter& filter, double way_m);

  /// Of a place on the filter's plane. `variance_m2`: of the place against the vehicle, per axis,
  /// without what the filter knows.
  Relation RelationOf(const Eigen::Vector2d& place_m, double variance_m2) const;

 private:
  struct Point {
    Eigen::Vector2d place_m;
    Eigen::Vector2d ahead;  // Unit vector.
    double way_m;
    double variance_m2;       // Sideways, if the road goes on as it does.
    double bend_variance_m2;  // Beside that, if it bends.
    double bend_share;        // Probability that it has bent until here.
  };
  struct Line {
    double weight;
    std::vector<Point> points;
  };

  Line Predict(const CourseFilter& filter, const CourseFilter::Mode& mode, double way_m) const;
  double OwnDensity(const Line& line, const Eigen::Vector2d& place_m, double variance_m2,
                    Relation& relation) const;

  Config config_;
  std::vector<Line> lines_;  // One per mode of the filter.
};

}  // namespace livemap::vehicle
