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
// Of a height by edges, whose plane may be a kerb's, and by one plane.
constexpr double kEdgesSigma = 0.1;
constexpr double kPlaneSigma = 0.03;
// The way between the images, against the height.
constexpr double kShortestRoadWay = 0.25;
constexpr double kLongestRoadWay = 3.0;
constexpr double kLeastAhead = 0.7;       // Of the direction of travel, along the optical axis.
constexpr double kWideHeightRatio = 1.6;  // Of the wide search, up and down from its guess.
constexpr double kWideRollRad = 0.03;

RoadPlaneSearch::Config WideAround(RoadPlaneSearch::Config config, double height_m) {
  config.lowest_m = height_m / kWideHeightRatio;
  config.highest_m = height_m * kWideHeightRatio;
  config.search_roll_rad = kWideRollRad;
  return config;
}

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

std::optional<double> RoadHeightOfEdges(const std::vector<EdgeDepth>& edges,
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

RoadHeightMeter::RoadHeightMeter(const Config& config, const geo::CameraIntrinsics& camera)
    : config_(config),
      camera_(camera),
      near_(config.plane, camera),
      wide_(WideAround(config.plane, config.camera_height_m), camera) {}

void RoadHeightMeter::Reset() {
  units_.reset();
  roll_rad_ = 0;
  failures_ = 0;
}

std::optional<RoadHeight> RoadHeightMeter::Measure(const PosedImage& now, const PosedImage& before,
                                                   const std::vector<EdgeDepth>& edges) {
  Eigen::Isometry3d before_from_now = before.world_from_camera.inverse() * now.world_from_camera;
  const double way_units = before_from_now.translation().norm();
  const Eigen::Vector3d forward =
      before_from_now.linear().transpose() * before_from_now.translation() / way_units;
  // Written so that NaN is refused.
  if (!(forward.z() > kLeastAhead)) return std::nullopt;
  const double pitch_rad = config_.camera_pitch_rad.value_or(-std::asin(forward.y()));
  std::optional<double> about = units_;
  if (!about) about = RoadHeightOfEdges(edges, camera_, pitch_rad);
  if (!about || way_units > kLongestRoadWay * *about) return std::nullopt;
  const RoadHeight by_edges{*about, kEdgesSigma};
  const bool far_enough = way_units >= kShortestRoadWay * *about;
  const double metres_per_unit = config_.camera_height_m / *about;
  std::optional<RoadPlane> plane;
  if (far_enough) {
    now_.Build(now.smooth);
    before_.Build(before.smooth);
    // What is seen now was in view before, too, further ahead.
    before_from_now.translation() *= metres_per_unit;
    plane = FindPlane({now_, before_, before_from_now}, forward);
  }
  if (!plane) {
    if (!units_) return by_edges;
    if (far_enough && ++failures_ >= 2 * config_.max_failures) Reset();
    return std::nullopt;
  }
  failures_ = 0;
  units_ = plane->distance / metres_per_unit;
  return RoadHeight{*units_, kPlaneSigma};
}

/// The plane in about metres; `forward` is the direction of travel as the camera sees it.
std::optional<RoadPlane> RoadHeightMeter::FindPlane(const RoadView& view,
                                                    const Eigen::Vector3d& forward) {
  const Eigen::Vector3d tilted(-std::sin(roll_rad_), std::cos(roll_rad_), 0);
  const Eigen::Vector3d down = (tilted - forward.dot(tilted) * forward).normalized();
  Mounting guess = MountingOfAxes({forward, down});
  guess.height_m = config_.camera_height_m;
  const bool is_known = units_ && failures_ < config_.max_failures;
  const std::optional<RoadPlane> plane =
      is_known ? near_.Refine(view, guess) : wide_.Search(view, guess);
  if (plane) roll_rad_ = -std::atan2(plane->down.x(), plane->down.y());
  return plane;
}

}  // namespace livemap::odometry
