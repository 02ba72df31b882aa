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

PlacedHazard MiddleOf(const PlacedHazard& foot, const geo::GeoPoint& seen_from,
                      double half_depth_m) {
  constexpr double kNearestFootM = 1.0;  // Nearer than this nothing lies behind anything.
  const geo::LocalFrame frame(seen_from);
  const Eigen::Vector2d foot_m = frame.ToEnu(foot.position);
  const double range_m = foot_m.norm();
  if (half_depth_m <= 0 || range_m < kNearestFootM) return foot;
  const Eigen::Vector2d behind_m = half_depth_m / range_m * foot_m;
  PlacedHazard middle = foot;
  middle.position = frame.ToGeo(foot_m + behind_m);
  middle.covariance_m2 += 0.25 * behind_m * behind_m.transpose();
  return middle;
}

}  // namespace livemap::placement
