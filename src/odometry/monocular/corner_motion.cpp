#include "odometry/monocular/corner_motion.h"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "odometry/se3.h"

namespace livemap::odometry {
namespace {

constexpr float kThereAndBackPx = 1.0F;
constexpr double kCheckedCornerQuality = 0.005;
constexpr double kCheckedCornerDistancePx = 12;
constexpr double kLeastMotion = 1e-6;  // Of a motion that has a direction.

/// Huber's, of which large errors do not matter much.
double RobustSum(const Eigen::VectorXd& errors, double inlier_px) {
  const Eigen::ArrayXd size = errors.array().abs();
  const Eigen::ArrayXd clipped = size.min(inlier_px);
  return (clipped * (2 * size - clipped)).sum();
}

/// The motion after a turn and a move of its translation to either side.
Eigen::Isometry3d MovedOnSphere(const Eigen::Isometry3d& from,
                                const Eigen::Matrix<double, 5, 1>& delta) {
  const Eigen::Vector3d t = from.translation();
  const Eigen::Vector3d side = t.unitOrthogonal();
  Vector6d turn = Vector6d::Zero();
  turn.tail<3>() = delta.head<3>();
  Eigen::Isometry3d to = from;
  to.linear() = from.linear() * Se3Exp(turn).linear();
  to.translation() = (t + delta[3] * side + delta[4] * t.cross(side)).normalized();
  return to;
}

}  // namespace

Eigen::Vector3d RayOfCorner(const cv::Point2f& pixel, const geo::CameraIntrinsics& camera) {
  return {(static_cast<double>(pixel.x) - camera.cx) / camera.fx,
          (static_cast<double>(pixel.y) - camera.cy) / camera.fy, 1};
}

FollowedCorners FollowCorners(const cv::Mat& before, const cv::Mat& now,
                              const std::vector<cv::Point2f>& corners) {
  FollowedCorners followed;
  std::vector<cv::Point2f> back;
  std::vector<std::uint8_t> found_back;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(before, now, corners, followed.now, followed.found, error);
  cv::calcOpticalFlowPyrLK(now, before, followed.now, back, found_back, error);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const cv::Point2f way = back[i] - corners[i];
    const bool same = std::hypot(way.x, way.y) <= kThereAndBackPx;
    followed.found[i] = followed.found[i] != 0 && found_back[i] != 0 && same ? 1 : 0;
  }
  return followed;
}

Eigen::VectorXd SampsonErrors(const CornerPairs& corners, const geo::CameraIntrinsics& camera,
                              const Eigen::Isometry3d& now_from_before) {
  const Eigen::Matrix3d essential =
      CrossMatrix(now_from_before.translation()) * now_from_before.linear();
  Eigen::VectorXd errors(static_cast<Eigen::Index>(corners.before.size()));
  for (std::size_t i = 0; i < corners.before.size(); ++i) {
    const Eigen::Vector3d before = RayOfCorner(corners.before[i], camera),
                          now = RayOfCorner(corners.now[i], camera);
    const Eigen::Vector3d line = essential * before;
    const Eigen::Vector3d line_back = essential.transpose() * now;
    const double slope =
        std::sqrt(line.head<2>().squaredNorm() + line_back.head<2>().squaredNorm());
    errors[static_cast<Eigen::Index>(i)] = camera.fx * now.dot(line) / slope;
  }
  return errors;
}

void RefineByCorners(const CornerPairs& corners, const geo::CameraIntrinsics& camera,
                     double inlier_px, Eigen::Isometry3d& now_from_before) {
  constexpr int kUnknowns = 5;
  constexpr double kStep = 1e-6;
  const double way = now_from_before.translation().norm();
  now_from_before.translation() /= way;
  Eigen::VectorXd errors = SampsonErrors(corners, camera, now_from_before);
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix<double, Eigen::Dynamic, kUnknowns> jacobian(errors.size(), kUnknowns);
    for (int i = 0; i < kUnknowns; ++i) {
      const Eigen::Matrix<double, kUnknowns, 1> delta =
          kStep * Eigen::Matrix<double, kUnknowns, 1>::Unit(i);
      jacobian.col(i) =
          (SampsonErrors(corners, camera, MovedOnSphere(now_from_before, delta)) - errors) / kStep;
    }
    const Eigen::VectorXd weights = (inlier_px / errors.array().abs().max(inlier_px)).matrix();
    const Eigen::Matrix<double, kUnknowns, kUnknowns> normal =
        jacobian.transpose() * weights.asDiagonal() * jacobian;
    const Eigen::Matrix<double, kUnknowns, 1> step =
        normal.ldlt().solve(jacobian.transpose() * weights.asDiagonal() * errors);
    if (!step.allFinite()) break;
    const Eigen::Isometry3d candidate = MovedOnSphere(now_from_before, -step);
    const Eigen::VectorXd candidate_errors = SampsonErrors(corners, camera, candidate);
    if (!(RobustSum(candidate_errors, inlier_px) < RobustSum(errors, inlier_px))) break;
    now_from_before = candidate;
    errors = candidate_errors;
  }
  now_from_before.translation() *= way;
}

std::optional<Eigen::Isometry3d> CornerCheck::Contradicting(
    const cv::Mat& before, const cv::Mat& now, const Eigen::Isometry3d& now_from_before) const {
  // Written so that NaN is refused.
  if (!(now_from_before.translation().norm() > kLeastMotion)) return std::nullopt;
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(before, corners, config_.corners, kCheckedCornerQuality,
                          kCheckedCornerDistancePx);
  if (corners.size() < config_.min_corners) return std::nullopt;
  FollowedCorners followed = FollowCorners(before, now, corners);
  std::size_t count = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (followed.found[i] == 0) continue;
    corners[count] = corners[i];
    followed.now[count++] = followed.now[i];
  }
  if (count < config_.min_corners) return std::nullopt;
  corners.resize(count);
  followed.now.resize(count);
  const CornerPairs pairs{corners, followed.now};
  Eigen::Isometry3d refined = now_from_before;
  RefineByCorners(pairs, camera_, config_.inlier_px, refined);
  const Eigen::AngleAxisd turn(now_from_before.linear().transpose() * refined.linear());
  if (!(turn.angle() >= config_.least_turn_rad)) return std::nullopt;
  const Eigen::VectorXd left = SampsonErrors(pairs, camera_, refined);
  const auto inliers = static_cast<double>((left.array().abs() < config_.inlier_px).count());
  const double given = RobustSum(SampsonErrors(pairs, camera_, now_from_before), config_.inlier_px);
  if (inliers < config_.min_inliers * static_cast<double>(count) ||
      RobustSum(left, config_.inlier_px) > config_.most_error * given) {
    return std::nullopt;
  }
  return refined;
}

}  // namespace livemap::odometry
