#include "odometry/monocular/road_height.h"

#include <Eigen/Dense>
#include <cmath>
#include <random>

namespace livemap::odometry {
namespace {

constexpr int kTrials = 200;
constexpr std::size_t kMinEdges = 60;
constexpr double kMinShare = 0.3;     // Of the edges in the wedge.
constexpr double kMinSlope = 0.06;    // Rays that come down less steeply end too far away.
constexpr double kWidestRatio = 2.0;  // Half width of the wedge, against the height.
constexpr double kMaxTiltRad = 0.06;  // Of the plane against the wheels'.
constexpr double kNearPlane = 0.03;   // Against the height.
constexpr double kWorstRelativeSigma = 0.1;

/// Points on the part of the image that is mostly road: a wedge ahead of the car.
std::vector<Eigen::Vector3d> RoadPointsAhead(const std::vector<EdgeDepth>& edges,
                                             const geo::CameraIntrinsics& camera,
                                             const Eigen::Vector3d& down) {
  std::vector<Eigen::Vector3d> points;
  for (const EdgeDepth& edge : edges) {
    const double worst = kWorstRelativeSigma * static_cast<double>(edge.inverse_depth);
    if (!edge.known || static_cast<double>(edge.variance) > worst * worst) continue;
    const Eigen::Vector3d ray((edge.u - camera.cx) / camera.fx, (edge.v - camera.cy) / camera.fy,
                              1);
    const double slope = ray.dot(down);
    if (slope < kMinSlope || std::abs(ray.x()) > kWidestRatio * slope) continue;
    points.push_back(ray / static_cast<double>(edge.inverse_depth));
  }
  return points;
}

}  // namespace

std::optional<double> RoadHeight(const std::vector<EdgeDepth>& edges,
                                 const geo::CameraIntrinsics& camera, double pitch_rad) {
  const Eigen::Vector3d down(0, std::cos(pitch_rad), std::sin(pitch_rad));
  const std::vector<Eigen::Vector3d> points = RoadPointsAhead(edges, camera, down);
  if (points.size() < kMinEdges) return std::nullopt;
  std::mt19937 random(1);  // The same edges give the same answer.
  std::uniform_int_distribution<std::size_t> any(0, points.size() - 1);
  std::size_t most = 0;
  Eigen::Vector3d best_normal = down;
  double best_height = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector3d &a = points[any(random)], &b = points[any(random)],
                          &c = points[any(random)];
    Eigen::Vector3d normal = (b - a).cross(c - a);
    if (!(normal.norm() > 1e-9)) continue;
    normal.normalize();
    if (normal.dot(down) < 0) normal = -normal;
    if (normal.dot(down) < std::cos(kMaxTiltRad)) continue;
    const double height = normal.dot(a);
    if (height <= 0) continue;
    std::size_t near = 0;
    for (const Eigen::Vector3d& point : points) {
      near += std::abs(normal.dot(point) - height) < kNearPlane * height ? 1U : 0U;
    }
    if (near <= most) continue;
    most = near;
    best_normal = normal;
    best_height = height;
  }
  if (static_cast<double>(most) < kMinShare * static_cast<double>(points.size())) {
    return std::nullopt;
  }
  // The mean of those on it.
  double sum = 0;
  for (const Eigen::Vector3d& point : points) {
    const double height = best_normal.dot(point);
    if (std::abs(height - best_height) < kNearPlane * best_height) sum += height;
  }
  return sum / static_cast<double>(most);
}

}  // namespace livemap::odometry
