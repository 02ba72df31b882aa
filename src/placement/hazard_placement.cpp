#include "placement/hazard_placement.h"

#include <cmath>

namespace livemap::placement {

PlacedHazard PlaceHazard(const geo::TrackPose& antenna, const Eigen::Vector2d& antenna_in_base_m,
                         const geo::GroundPoint& ground) {
  const double sine = std::sin(antenna.course_rad);
  const double cosine = std::cos(antenna.course_rad);
  // Columns: base_link's forward and left axes in east-north coordinates.
  Eigen::Matrix2d enu_from_base;
  enu_from_base << sine, -cosine, cosine, sine;
  const Eigen::Vector2d from_antenna_m = enu_from_base * (ground.position_m - antenna_in_base_m);
  // A course error swings the point around the antenna: clockwise in east-north axes.
  const Eigen::Vector2d swing_m(from_antenna_m.y(), -from_antenna_m.x());

  PlacedHazard placed;
  placed.position = geo::LocalFrame(antenna.position).ToGeo(from_antenna_m);
  placed.covariance_m2 =
      antenna.covariance_m2 + enu_from_base * ground.covariance_m2 * enu_from_base.transpose() +
      antenna.course_variance_rad2 * swing_m * swing_m.transpose() +
      swing_m * antenna.position_course.transpose() + antenna.position_course * swing_m.transpose();
  return placed;
}

}  // namespace livemap::placement
