#include "odometry/mounting/road_plane.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "common/median.h"
#include "odometry/bilinear.h"

namespace livemap::odometry {

/// A pixel of the first image.
struct RoadPlaneSearch::Point {
  Eigen::Vector3d ray;  ///< Its z is 1.
  float grey;
  float gradient;  ///< Its length, grey levels per pixel.
};

struct RoadPlaneSearch::Fit {
  Eigen::Vector3d plane;  ///< The normal over the distance.
  double agreement = 0;
};

namespace {

constexpr int kPlaneSteps = 12;
constexpr double kLeastPlaneSigma = 1.5;   // Grey levels.
constexpr float kExplainedRoadGrey = 8;    // As in EdgeOdometry: grey levels,
constexpr float kExplainedRoadPx = 0.75F;  // or what so many pixels of the gradient make.
constexpr int kSearchPoints = 600;
constexpr double kHeightRatio = 1.04;  // From one tried height to the next.
constexpr double kPitchStepRad = 0.0065;
constexpr double kRollStepRad = 0.015;
constexpr std::size_t kRefinedGuesses = 4;
constexpr int kDepthTrials = 100;
constexpr std::size_t kLeastDepths = 200;
constexpr int kDepthStride = 3;         // Every so many pixels, both ways.
constexpr double kNearDepth = 0.02;     // Of the plane, as a share of the inverse depth.
constexpr double kLeastOnPlane = 0.6;   // Share of the depths.
constexpr double kDepthTiltRad = 0.15;  // Against the guess: roll is not known.

bool IsInside(const cv::Mat& image, double u, double v) {
  return u >= 1 && v >= 1 && u < image.cols - 2 && v < image.rows - 2;
}

Eigen::Vector3d PlaneOfMounting(const Mounting& mounting) {
  return AxesInCamera(mounting).down / mounting.height_m;
}

/// Where the second image sees a point of the plane, and what it needs for derivatives.
struct SeenOnPlane {
  double u, v;
  Eigen::Vector3d place;
};

class PlaneWarp {
 public:
  PlaneWarp(const geo::CameraIntrinsics& camera, const Eigen::Isometry3d& second_from_first)
      : camera_(camera),
        rotation_(second_from_first.linear()),
        translation_(second_from_first.translation()) {}

  /// False when it is behind the camera.
  bool See(const Eigen::Vector3d& ray, const Eigen::Vector3d& plane, SeenOnPlane& seen) const {
    seen.place = rotation_ * ray + translation_ * plane.dot(ray);
    if (!(seen.place.z() > 1e-3)) return false;
    seen.u = camera_.fx * seen.place.x() / seen.place.z() + camera_.cx;
    seen.v = camera_.fy * seen.place.y() / seen.place.z() + camera_.cy;
    return true;
  }

  /// How a grey value changes with plane . ray, for its gradient at `seen`.
  double Slope(const SeenOnPlane& seen, double gradient_u, double gradient_v) const {
    const double inverse = 1 / seen.place.z();
    const double du =
        camera_.fx * inverse * (translation_.x() - seen.place.x() * inverse * translation_.z());
    const double dv =
        camera_.fy * inverse * (translation_.y() - seen.place.y() * inverse * translation_.z());
    return gradient_u * du + gradient_v * dv;
  }

 private:
  geo::CameraIntrinsics camera_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d translation_;
};

struct RoadDepth {
  Eigen::Vector3d ray;  // Its z is 1.
  double inverse_depth;
};

/// The depths of the patch, if the camera is mounted so.
std::vector<RoadDepth> RoadDepthsOf(const cv::Mat& depth_m, const geo::CameraIntrinsics& camera,
                                    const RoadPatch& patch, const Mounting& guess) {
  const Eigen::Matrix3d base_from_optical = BaseFromOpticalRotation(guess);
  std::vector<RoadDepth> depths;
  for (int v = 0; v < depth_m.rows; v += kDepthStride) {
    const float* row = depth_m.ptr<float>(v);
    for (int u = 0; u < depth_m.cols; u += kDepthStride) {
      const auto depth = static_cast<double>(row[u]);
      if (!(depth > 0.1 && depth < 100)) continue;
      const Eigen::Vector3d ray((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
      const Eigen::Vector3d in_base = base_from_optical * ray * depth;
      if (in_base.z() > -0.5 * guess.height_m || in_base.x() > patch.farthest_m ||
          std::abs(in_base.y()) > patch.half_width_m) {
        continue;
      }
      depths.push_back({ray, 1 / depth});
    }
  }
  return depths;
}

bool IsNearPlane(const RoadDepth& depth, const Eigen::Vector3d& plane) {
  return std::abs(plane.dot(depth.ray) - depth.inverse_depth) < kNearDepth * depth.inverse_depth;
}

std::size_t CountNearPlane(const std::vector<RoadDepth>& depths, const Eigen::Vector3d& plane) {
  return static_cast<std::size_t>(
      std::count_if(depths.begin(), depths.end(),
                    [&plane](const RoadDepth& depth) { return IsNearPlane(depth, plane); }));
}

/// The plane of most depths: of three at a time, then of all that lie on it. An inverse depth is
/// linear in the plane's three numbers.
Eigen::Vector3d PlaneOfDepths(const std::vector<RoadDepth>& depths, const Eigen::Vector3d& down) {
  std::mt19937 random(1);  // The same depths give the same answer.
  std::uniform_int_distribution<std::size_t> any(0, depths.size() - 1);
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  std::size_t most = 0;
  for (int trial = 0; trial < kDepthTrials; ++trial) {
    Eigen::Matrix3d rays;
    Eigen::Vector3d inverse;
    for (int i = 0; i < 3; ++i) {
      const RoadDepth& depth = depths[any(random)];
      rays.row(i) = depth.ray;
      inverse[i] = depth.inverse_depth;
    }
    const Eigen::Vector3d plane = rays.fullPivLu().solve(inverse);
    if (!plane.allFinite() || plane.dot(down) < std::cos(kDepthTiltRad) * plane.norm()) continue;
    const std::size_t near = CountNearPlane(depths, plane);
    if (near <= most) continue;
    most = near;
    best = plane;
  }
  if (most < kLeastDepths) return best;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const RoadDepth& depth : depths) {
    if (!IsNearPlane(depth, best)) continue;
    const double weight = 1 / (depth.inverse_depth * depth.inverse_depth);
    normal += weight * depth.ray * depth.ray.transpose();
    right += weight * depth.ray * depth.inverse_depth;
  }
  return normal.ldlt().solve(right);
}

}  // namespace

RoadPlaneSearch::RoadPlaneSearch(const Config& config, const geo::CameraIntrinsics& camera)
    : config_(config), camera_(camera) {}

geo::CameraIntrinsics RoadPlaneSearch::CameraOf(int level) const {
  geo::CameraIntrinsics camera = camera_;
  for (int i = 0; i < level; ++i) camera = HalvedIntrinsics(camera);
  return camera;
}

/// The pixels with texture that see the patch, if the camera is mounted so; thinned evenly.
std::vector<RoadPlaneSearch::Point> RoadPlaneSearch::PointsOf(const ImagePyramid& pyramid,
                                                              int level, const Mounting& guess,
                                                              int max_points) const {
  const cv::Mat& image = pyramid[level];
  const geo::CameraIntrinsics camera = CameraOf(level);
  const Eigen::Matrix3d base_from_optical = BaseFromOpticalRotation(guess);
  std::vector<Point> all;
  for (int v = 1; v < image.rows - 1; ++v) {
    const std::uint8_t *above = image.ptr(v - 1), *row = image.ptr(v), *below = image.ptr(v + 1);
    for (int u = 1; u < image.cols - 1; ++u) {
      const Eigen::Vector3d ray((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
      const Eigen::Vector3d in_base = base_from_optical * ray;
      if (!(in_base.z() < -1e-3)) continue;
      const double stretch = -guess.height_m / in_base.z();
      const double ahead = in_base.x() * stretch, left = in_base.y() * stretch;
      if (ahead < config_.patch.nearest_m || ahead > config_.patch.farthest_m ||
          std::abs(left) > config_.patch.half_width_m) {
        continue;
      }
      const auto along_u = 0.5F * static_cast<float>(row[u + 1] - row[u - 1]);
      const auto along_v = 0.5F * static_cast<float>(below[u] - above[u]);
      const float gradient = std::hypot(along_u, along_v);
      if (gradient < config_.min_gradient) continue;
      all.push_back({ray, static_cast<float>(row[u]), gradient});
    }
  }
  if (all.size() <= static_cast<std::size_t>(max_points)) return all;
  std::vector<Point> some;
  some.reserve(static_cast<std::size_t>(max_points));
  for (int i = 0; i < max_points; ++i) {
    some.push_back(
        all[static_cast<std::size_t>(i) * all.size() / static_cast<std::size_t>(max_points)]);
  }
  return some;
}

/// Mean absolute residual, each at most 30 grey levels, without the difference of the means;
/// infinite where less than half of the points are in view.
double RoadPlaneSearch::Cost(const std::vector<Point>& points, const RoadView& view, int level,
                             const Eigen::Vector3d& plane) const {
  const cv::Mat& image = view.second[level];
  const PlaneWarp warp(CameraOf(level), view.second_from_first);
  std::vector<double> residuals;
  residuals.reserve(points.size());
  for (const Point& point : points) {
    SeenOnPlane seen{};
    if (!warp.See(point.ray, plane, seen) || !IsInside(image, seen.u, seen.v)) continue;
    residuals.push_back(static_cast<double>(
        Interpolate(image, static_cast<float>(seen.u), static_cast<float>(seen.v)) - point.grey));
  }
  if (residuals.size() * 2 < points.size()) return std::numeric_limits<double>::infinity();
  const double shift = TakeMedian(residuals);
  double sum = 0;
  for (const double residual : residuals) sum += std::min(30.0, std::abs(residual - shift));
  return sum / static_cast<double>(residuals.size());
}

std::optional<RoadPlaneSearch::Fit> RoadPlaneSearch::Align(const RoadView& view, int level,
                                                           const std::vector<Point>& points,
                                                           const Eigen::Vector3d& start) const {
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  using Matrix5d = Eigen::Matrix<double, 5, 5>;
  const cv::Mat& image = view.second[level];
  const PlaneWarp warp(CameraOf(level), view.second_from_first);
  Fit fit{start};
  double gain = 1, bias = 0;
  struct Row {
    Vector5d slopes;
    double residual;
    float gradient;
  };
  std::vector<Row> rows;
  std::vector<double> sizes;
  for (int step = 0; step < kPlaneSteps; ++step) {
    rows.clear();
    sizes.clear();
    for (const Point& point : points) {
      SeenOnPlane seen{};
      if (!warp.See(point.ray, fit.plane, seen) || !IsInside(image, seen.u, seen.v)) continue;
      const auto u = static_cast<float>(seen.u), v = static_cast<float>(seen.v);
      const float grey = Interpolate(image, u, v);
      const double along_u =
          static_cast<double>(0.5F * (Interpolate(image, u + 1, v) - Interpolate(image, u - 1, v)));
      const double along_v =
          static_cast<double>(0.5F * (Interpolate(image, u, v + 1) - Interpolate(image, u, v - 1)));
      Row row;
      row.slopes << warp.Slope(seen, along_u, along_v) * point.ray,
          -static_cast<double>(point.grey), -1;
      row.residual = static_cast<double>(grey) - gain * static_cast<double>(point.grey) - bias;
      row.gradient = point.gradient;
      rows.push_back(row);
      sizes.push_back(std::abs(row.residual));
    }
    if (rows.size() < config_.min_points || rows.size() * 2 < points.size()) return std::nullopt;
    const double sigma = std::max(kLeastPlaneSigma, kMedianToSigma * TakeMedian(sizes));
    Matrix5d normal = Matrix5d::Zero();
    Vector5d right = Vector5d::Zero();
    std::size_t explained = 0;
    for (const Row& row : rows) {
      const double weight = std::min(1.0, 2 * sigma / std::max(1e-9, std::abs(row.residual)));
      normal += weight * row.slopes * row.slopes.transpose();
      right -= weight * row.slopes * row.residual;
      const float most = std::max(kExplainedRoadGrey, kExplainedRoadPx * row.gradient);
      explained += std::abs(row.residual) <= static_cast<double>(most) ? 1U : 0U;
    }
    fit.agreement = static_cast<double>(explained) / static_cast<double>(rows.size());
    normal.diagonal() *= 1 + 1e-9;
    const Vector5d change = normal.ldlt().solve(right);
    if (!change.allFinite()) return std::nullopt;
    fit.plane += change.head<3>();
    gain += change[3];
    bias += change[4];
    if (change.head<3>().norm() < 1e-5 * fit.plane.norm()) break;
  }
  if (!(gain > 0.3 && gain < 3)) return std::nullopt;
  return fit;
}

std::optional<RoadPlane> RoadPlaneSearch::Refine(const RoadView& view,
                                                 const Mounting& guess) const {
  const Eigen::Vector3d start = PlaneOfMounting(guess);
  std::optional<Fit> fit;
  Eigen::Vector3d plane = start;
  for (int level = std::min(1, view.first.levels() - 1); level >= 0; --level) {
    const std::vector<Point> points = PointsOf(view.first, level, guess, config_.max_points);
    if (points.size() < config_.min_points) return std::nullopt;
    fit = Align(view, level, points, plane);
    if (!fit) return std::nullopt;
    plane = fit->plane;
  }
  if (fit->agreement < config_.min_agreement) return std::nullopt;
  RoadPlane road;
  road.distance = 1 / plane.norm();
  road.down = plane * road.distance;
  // Written so that NaN is refused.
  const double tilt = std::acos(std::min(1.0, road.down.dot(start.normalized())));
  const double change = std::abs(std::log(road.distance / guess.height_m));
  if (!(tilt < config_.max_tilt_rad && change < config_.max_height_change)) return std::nullopt;
  return road;
}

std::optional<RoadPlane> RoadPlaneSearch::Search(const RoadView& view,
                                                 const Mounting& guess) const {
  const int level = view.first.levels() - 1;
  struct Tried {
    double cost;
    Mounting mounting;
  };
  std::vector<Tried> tried;
  Mounting mounting = guess;
  const std::vector<Point> points = PointsOf(view.first, level, guess, kSearchPoints);
  if (points.size() < config_.min_points) return std::nullopt;
  for (double height = config_.lowest_m; height < config_.highest_m; height *= kHeightRatio) {
    mounting.height_m = height;
    for (double pitch = -config_.search_pitch_rad; pitch <= config_.search_pitch_rad;
         pitch += kPitchStepRad) {
      mounting.pitch_rad = guess.pitch_rad + pitch;
      for (double roll = -config_.search_roll_rad; roll <= config_.search_roll_rad;
           roll += kRollStepRad) {
        mounting.roll_rad = guess.roll_rad + roll;
        tried.push_back({Cost(points, view, level, PlaneOfMounting(mounting)), mounting});
      }
    }
  }
  const std::size_t kept = std::min(kRefinedGuesses, tried.size());
  std::partial_sort(tried.begin(), tried.begin() + static_cast<std::ptrdiff_t>(kept), tried.end(),
                    [](const Tried& a, const Tried& b) { return a.cost < b.cost; });
  std::optional<RoadPlane> best;
  double least = std::numeric_limits<double>::infinity();
  const std::vector<Point> fine = PointsOf(view.first, 0, tried.front().mounting, kSearchPoints);
  for (std::size_t i = 0; i < kept; ++i) {
    const std::optional<RoadPlane> road = Refine(view, tried[i].mounting);
    if (!road) continue;
    const double cost = Cost(fine, view, 0, road->down / road->distance);
    if (!(cost < least)) continue;
    least = cost;
    best = road;
  }
  return best;
}

std::optional<RoadPlane> FitRoadPlane(const cv::Mat& depth_m, const geo::CameraIntrinsics& camera,
                                      const RoadPatch& patch, const Mounting& guess) {
  const std::vector<RoadDepth> depths = RoadDepthsOf(depth_m, camera, patch, guess);
  if (depths.size() < kLeastDepths) return std::nullopt;
  const Eigen::Vector3d plane = PlaneOfDepths(depths, AxesInCamera(guess).down);
  const auto share =
      static_cast<double>(CountNearPlane(depths, plane)) / static_cast<double>(depths.size());
  // Written so that NaN is refused.
  if (!(plane.norm() > 0 && share >= kLeastOnPlane)) return std::nullopt;
  return RoadPlane{plane.normalized(), 1 / plane.norm()};
}

}  // namespace livemap::odometry
