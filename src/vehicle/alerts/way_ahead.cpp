#include "vehicle/alerts/way_ahead.h"

#include <algorithm>
#include <cmath>

namespace livemap::vehicle {
namespace {

/// Of a normal distribution with mean 0.
double DensityAt(double value, double variance) {
  return std::exp(-0.5 * value * value / variance) / std::sqrt(2 * M_PI * variance);
}

}  // namespace

WayAhead::WayAhead(const Config& config, const CourseFilter& filter, double way_m)
    : config_(config) {
  for (const CourseFilter::Mode& mode : filter.modes()) {
    lines_.push_back(Predict(filter, mode, way_m));
  }
}

WayAhead::Line WayAhead::Predict(const CourseFilter& filter, const CourseFilter::Mode& mode,
                                 double way_m) const {
  const double course_rad = mode.state[CourseFilter::kCourse];
  // What the filter does not know, seen across the way: sideways place, course, curvature.
  Eigen::Matrix<double, 3, 6> across = Eigen::Matrix<double, 3, 6>::Zero();
  across.block<1, 2>(0, 0) = Eigen::RowVector2d(std::cos(course_rad), -std::sin(course_rad));
  across(1, CourseFilter::kCourse) = 1;
  across(2, CourseFilter::kCurvature) = 1;
  const Eigen::Matrix3d unknown = across * mode.covariance * across.transpose();

  const double speed = std::max(0.0, mode.state[CourseFilter::kSpeed]);
  const double bend = filter.CurvatureSigma(filter.config().sideways_mps2, speed);
  const double lasting_m =
      std::max(filter.config().curvature_way_m, filter.config().curvature_time_s * speed);
  const double step_m = config_.step_m;
  const double keep = std::exp(-step_m / lasting_m);
  const auto steps =
      static_cast<int>(std::min(std::max(0.0, way_m), config_.max_way_m) / step_m) + 1;
  Eigen::Vector2d place_m = mode.state.head<2>();
  double heading_rad = course_rad;
  double curvature = mode.state[CourseFilter::kCurvature];
  Eigen::Vector3d from_state(1, 0, 0);  // How the sideways place depends on the unknown.
  double course_by_curvature = 0;
  Line line{mode.weight, {}};
  line.points.reserve(static_cast<std::size_t>(steps) + 1);
  for (int i = 0; i <= steps; ++i) {
    const double at_m = i * step_m;
    // A curvature that comes at a place evenly distributed between here and there moves the way
    // by half the square of the rest: s^4 / 20 in the mean square.
    const double bent = bend * at_m * at_m;
    line.points.push_back({place_m,
                           {std::sin(heading_rad), std::cos(heading_rad)},
                           at_m,
                           from_state.dot(unknown * from_state),
                           bent * bent / 20,
                           1 - std::exp(-at_m / config_.bend_spacing_m)});
    const double middle_rad = heading_rad + 0.5 * curvature * step_m;
    place_m += step_m * Eigen::Vector2d(std::sin(middle_rad), std::cos(middle_rad));
    heading_rad += curvature * step_m;
    curvature *= keep;
    from_state[1] += step_m;
    from_state[2] += course_by_curvature * step_m;
    course_by_curvature += step_m * std::exp(-at_m / lasting_m);
  }
  return line;
}

/// Fills in `relation` by this line, but for the probability.
double WayAhead::OwnDensity(const Line& line, const Eigen::Vector2d& place_m, double variance_m2,
                            Relation& relation) const {
  const std::vector<Point>& points = line.points;
  const auto left_of = [&place_m](const Point& point) {
    const Eigen::Vector2d from = place_m - point.place_m;
    return from.y() * point.ahead.x() - from.x() * point.ahead.y();
  };
  relation.forward_m = points.front().ahead.dot(place_m - points.front().place_m);
  relation.left_m = left_of(points.front());
  const auto nearest =
      std::min_element(points.begin(), points.end(), [&](const Point& a, const Point& b) {
        return (place_m - a.place_m).squaredNorm() < (place_m - b.place_m).squaredNorm();
      });
  const double beyond_m = nearest->ahead.dot(place_m - nearest->place_m);
  if (nearest == points.begin() && beyond_m < 0) return 0;
  if (std::next(nearest) == points.end() && beyond_m > 0) return 0;
  relation.ahead = true;
  relation.way_m = nearest->way_m + beyond_m;
  relation.left_m = left_of(*nearest);
  relation.course_rad = std::atan2(nearest->ahead.x(), nearest->ahead.y());
  const double steady_m2 =
      nearest->variance_m2 + variance_m2 + config_.lane_sigma_m * config_.lane_sigma_m;
  const double bent_m2 = steady_m2 + nearest->bend_variance_m2;
  return (1 - nearest->bend_share) * DensityAt(relation.left_m, steady_m2) +
         nearest->bend_share * DensityAt(relation.left_m, bent_m2);
}

WayAhead::Relation WayAhead::RelationOf(const Eigen::Vector2d& place_m, double variance_m2) const {
  Relation best;
  double best_share = -1;
  double own = 0;
  for (const Line& line : lines_) {
    Relation relation;
    const double share = line.weight * OwnDensity(line, place_m, variance_m2, relation);
    own += share;
    const bool better = relation.ahead == best.ahead ? share > best_share : relation.ahead;
    if (best_share < 0 || better) {
      best = relation;
      best_share = share;
    }
  }
  if (best.ahead) best.probability = own / (own + config_.others_per_m);
  return best;
}

}  // namespace livemap::vehicle
