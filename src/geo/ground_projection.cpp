#include "geo/ground_projection.h"

#include <cmath>

namespace livemap::geo {
namespace {

/// Derivative of the ground point by a change `direction_change` of the ray's direction.
/// From P = C - (C_z / d_z) d, for the first two coordinates:
///   dP = -(C_z / d_z) (dd - d (dd_z / d_z)).
Eigen::Vector2d MoveOfGroundPoint(double camera_height_m, const Eigen::Vector3d& direction,
                                  const Eigen::Vector3d& direction_change) {
  const double scale = -camera_height_m / direction.z();
  const double along = direction_change.z() / direction.z();
  return scale * (direction_change - along * direction).head<2>();
}

constexpr double kLeastDepthM = 1e-3;  // Along the optical axis; nearer counts as behind.

/// Without the pixel. `direction` has 1 along the optical axis.
GroundSensitivity SensitivityAlong(const Eigen::Vector3d& direction, double camera_height_m,
                                   const CameraIntrinsics& intrinsics,
                                   const Eigen::Matrix3d& rotation) {
  GroundSensitivity moves;
  moves.per_pixel << MoveOfGroundPoint(camera_height_m, direction, rotation.col(0) / intrinsics.fx),
      MoveOfGroundPoint(camera_height_m, direction, rotation.col(1) / intrinsics.fy);
  moves.per_pitch =
      MoveOfGroundPoint(camera_height_m, direction, Eigen::Vector3d::UnitY().cross(direction));
  moves.per_height = -direction.head<2>() / direction.z();
  return moves;
}

bool AreUsableForProjection(const Eigen::Vector2d& pixel, const CameraIntrinsics& camera,
                            const Eigen::Isometry3d& base_from_optical) {
  return pixel.allFinite() && base_from_optical.matrix().allFinite() && std::isfinite(camera.fx) &&
         std::isfinite(camera.fy) && std::isfinite(camera.cx) && std::isfinite(camera.cy) &&
         camera.fx > 0 && camera.fy > 0;
}

}  // namespace

std::optional<GroundPoint> ProjectToGround(const Eigen::Vector2d& pixel,
                                           const CameraIntrinsics& intrinsics,
                                           const Eigen::Isometry3d& base_from_optical,
                                           const GroundProjectionNoise& noise) {
  if (!AreUsableForProjection(pixel, intrinsics, base_from_optical)) return std::nullopt;
  const Eigen::Matrix3d rotation = base_from_optical.linear();
  const Eigen::Vector3d centre = base_from_optical.translation();
  const Eigen::Vector3d direction =
      rotation * Eigen::Vector3d((pixel.x() - intrinsics.cx) / intrinsics.fx,
                                 (pixel.y() - intrinsics.cy) / intrinsics.fy, 1.0);
  if (centre.z() <= 0 || direction.z() >= 0) return std::nullopt;

  const double scale = -centre.z() / direction.z();
  const Eigen::Vector2d reach_m = scale * direction.head<2>();
  // Written so that an overflow to infinity or NaN is refused too.
  if (!(reach_m.norm() <= noise.max_range_m)) return std::nullopt;

  const GroundSensitivity moves = SensitivityAlong(direction, centre.z(), intrinsics, rotation);
  // Columns: pixel u, pixel v, pitch, height; each times its standard deviation.
  Eigen::Matrix<double, 2, 4> weighted;
  weighted << moves.per_pixel * noise.pixel_sigma_px, moves.per_pitch * noise.pitch_sigma_rad,
      moves.per_height * noise.height_sigma_m;

  GroundPoint point;
  point.position_m = centre.head<2>() + reach_m;
  point.covariance_m2 = weighted * weighted.transpose();
  return point;
}

std::optional<GroundSensitivity> SensitivityOfGroundPoint(
    const Eigen::Vector2d& point_m, const CameraIntrinsics& intrinsics,
    const Eigen::Isometry3d& base_from_optical) {
  if (!AreUsableForProjection(point_m, intrinsics, base_from_optical)) return std::nullopt;
  const Eigen::Vector3d centre = base_from_optical.translation();
  const Eigen::Vector3d from_camera_m = Eigen::Vector3d(point_m.x(), point_m.y(), 0) - centre;
  const Eigen::Vector3d optical_m = base_from_optical.linear().transpose() * from_camera_m;
  if (!(centre.z() > 0 && optical_m.z() > kLeastDepthM)) return std::nullopt;
  const Eigen::Vector3d direction = from_camera_m / optical_m.z();
  GroundSensitivity moves =
      SensitivityAlong(direction, centre.z(), intrinsics, base_from_optical.linear());
  moves.pixel = {intrinsics.fx * optical_m.x() / optical_m.z() + intrinsics.cx,
                 intrinsics.fy * optical_m.y() / optical_m.z() + intrinsics.cy};
  return moves;
}

}  // namespace livemap::geo
