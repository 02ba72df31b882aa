#include "placement/projected_place.h"

#include <cmath>
#include <optional>

#include "placement/hazard_placement.h"
#include "placement/road_ground_contact.h"

namespace livemap::placement {
namespace {

constexpr double kNearestM = 0.5;      // Along the optical axis; nearer counts as behind.
constexpr double kStepM = 0.05;        // Of the numerical Jacobian.
constexpr double kRegionSigmas = 2.0;  // Of the place that must be in the image.

/// East-north from base_link to pixels; none behind the camera.
std::optional<Eigen::Vector2d> ProjectToCamera(const Eigen::Vector2d& east_north_m,
                                               const PlacedCamera& camera) {
  const double sine = std::sin(camera.base.course_rad);
  const double cosine = std::cos(camera.base.course_rad);
  const Eigen::Vector3d in_base_m(sine * east_north_m.x() + cosine * east_north_m.y(),
                                  -cosine * east_north_m.x() + sine * east_north_m.y(), 0.0);
  const Eigen::Vector3d optical_m = camera.base_from_optical.inverse() * in_base_m;
  if (!(optical_m.z() > kNearestM)) return std::nullopt;
  const geo::CameraIntrinsics& k = camera.intrinsics;
  return Eigen::Vector2d(k.fx * optical_m.x() / optical_m.z() + k.cx,
                         k.fy * optical_m.y() / optical_m.z() + k.cy);
}

/// Of the place seen from base_link: its own, the position's and what the heading does to it.
Eigen::Matrix2d ProjectedCovariance(const Eigen::Vector2d& east_north_m,
                                    const Eigen::Matrix2d& place_m2, const geo::TrackPose& base) {
  const Eigen::Vector2d swing_m(east_north_m.y(), -east_north_m.x());
  return place_m2 + base.covariance_m2 + base.course_variance_rad2 * swing_m * swing_m.transpose() +
         swing_m * base.position_course.transpose() + base.position_course * swing_m.transpose();
}

bool IsProjectedInside(double pixel, double sigma_px, int size, double margin_share) {
  const double keep_px = kRegionSigmas * sigma_px + margin_share * size;
  return pixel >= keep_px && pixel <= size - 1 - keep_px;
}

}  // namespace

ProjectedPlace ProjectPlace(const geo::GeoPoint& place, const Eigen::Matrix2d& covariance_m2,
                            const PlacedCamera& camera, const geo::GroundProjectionNoise& noise,
                            double margin_share) {
  ProjectedPlace view;
  const Eigen::Vector2d place_m = geo::LocalFrame(camera.base.position).ToEnu(place);
  view.distance_m = place_m.norm();
  const auto pixel = ProjectToCamera(place_m, camera);
  const auto east = ProjectToCamera(place_m + Eigen::Vector2d(kStepM, 0), camera);
  const auto north = ProjectToCamera(place_m + Eigen::Vector2d(0, kStepM), camera);
  if (!pixel || !east || !north || !pixel->allFinite()) return view;
  view.pixel = *pixel;
  Eigen::Matrix2d pixels_per_m;
  pixels_per_m << (*east - *pixel) / kStepM, (*north - *pixel) / kStepM;
  const double pitch_px = camera.intrinsics.fy * noise.pitch_sigma_rad;
  view.covariance_px2 = pixels_per_m * ProjectedCovariance(place_m, covariance_m2, camera.base) *
                            pixels_per_m.transpose() +
                        noise.pixel_sigma_px * noise.pixel_sigma_px * Eigen::Matrix2d::Identity();
  view.covariance_px2(1, 1) += pitch_px * pitch_px;
  const bool inside = IsProjectedInside(pixel->x(), std::sqrt(view.covariance_px2(0, 0)),
                                        camera.intrinsics.width, margin_share) &&
                      IsProjectedInside(pixel->y(), std::sqrt(view.covariance_px2(1, 1)),
                                        camera.intrinsics.height, margin_share);
  view.visibility =
      inside ? ProjectedPlace::Visibility::kInside : ProjectedPlace::Visibility::kOutside;
  return view;
}

bool IsAtPlace(const imaging::Box& box, const geo::GeoPoint& place, const ProjectedPlace& view,
               const PlacedCamera& camera, const geo::GroundProjectionNoise& noise,
               double gate_sigma, double radius_m) {
  if (view.visibility == ProjectedPlace::Visibility::kBehind) return false;
  const Eigen::Vector2d foot = ContactPixel(box);
  const auto ground =
      geo::ProjectToGround(foot, camera.intrinsics, camera.base_from_optical, noise);
  // Far away a few pixels are many metres: it could be another one behind or before the place.
  if (!ground || LargestSigmaM(ground->covariance_m2) > radius_m / 2) return false;
  const Eigen::Vector2d apart_px = foot - view.pixel;
  if (apart_px.dot(view.covariance_px2.inverse() * apart_px) <= gate_sigma * gate_sigma) {
    return true;
  }
  const PlacedHazard placed = PlaceHazard(camera.base, Eigen::Vector2d::Zero(), *ground);
  return geo::GeodesicDistanceM(placed.position, place) <= radius_m;
}

}  // namespace livemap::placement
