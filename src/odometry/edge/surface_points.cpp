#include "odometry/edge/surface_points.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "common/median.h"
#include "odometry/se3.h"

namespace livemap::odometry {
namespace {

/// A depth camera errs by a share of the depth, and that share grows with it (disparities).
constexpr float kSurfaceError = 0.015F;
constexpr float kSurfaceErrorPerM = 0.004F;
/// Fewer measurements than this, if all points are asked for, say nothing.
constexpr std::size_t kSurfaceMinMeasured = 60;
/// How far to either side a point looks for the direction that its surface faces, px of the
/// coarsest level: the noise of a depth camera tilts what is nearer.
constexpr int kFacingReach = 3;
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

float SurfaceErrorAt(float depth_m) {
  return depth_m * (kSurfaceError + kSurfaceErrorPerM * depth_m);
}

Eigen::Vector3f SurfaceAt(const cv::Mat& depth_m, const geo::CameraIntrinsics& camera, int x,
                          int y) {
  const float depth = depth_m.at<float>(y, x);
  return {static_cast<float>((x - camera.cx) / camera.fx) * depth,
          static_cast<float>((y - camera.cy) / camera.fy) * depth, depth};
}

/// Whether the depths to either side of a pixel lie on one surface with its own. Inverse depths of
/// a plane are linear in the image.
bool IsEven(float one_side, float here, float other_side) {
  if (!(one_side > 0 && other_side > 0)) return false;
  return std::abs(0.5F * (1 / one_side + 1 / other_side) - 1 / here) * here * here <
         SurfaceErrorAt(here);
}

/// A frame's depth in metres at a pixel.
class FrameDepth {
 public:
  explicit FrameDepth(const RgbdFrame& frame)
      : depth_(frame.depth),
        m_per_unit_(frame.depth.type() == CV_16UC1 ? static_cast<float>(1 / frame.depth_units_per_m)
                                                   : 1) {}
  float At(int x, int y) const {
    return m_per_unit_ * (depth_.type() == CV_16UC1
                              ? static_cast<float>(depth_.at<std::uint16_t>(y, x))
                              : depth_.at<float>(y, x));
  }

 private:
  const cv::Mat& depth_;
  float m_per_unit_;
};

}  // namespace

void SurfaceDistances::Add(float distance) {
  values_[size_++] = distance;
  measured_ += std::isnan(distance) ? 0U : 1U;
}

double SurfaceDistances::Sigma() const {
  if (measured_ == 0) return std::numeric_limits<double>::infinity();
  std::array<float, kMost> magnitudes{};
  std::size_t count = 0;
  for (std::size_t i = 0; i < size_; ++i) {
    if (!std::isnan(values_[i])) magnitudes[count++] = std::abs(values_[i]);
  }
  float* const median = magnitudes.data() + count / 2;
  std::nth_element(magnitudes.data(), median, magnitudes.data() + count);
  return kMedianToSigma * static_cast<double>(*median);
}

double SurfaceDistances::ShareWithin(double bound) const {
  if (measured_ == 0) return 0;
  std::size_t within = 0;
  for (std::size_t i = 0; i < size_; ++i) within += std::abs(values_[i]) < bound ? 1U : 0U;
  return static_cast<double>(within) / static_cast<double>(measured_);
}

void SurfacePoints::Take(const cv::Mat& depth_m, const geo::CameraIntrinsics& camera) {
  constexpr std::size_t kMost = SurfaceDistances::kMost;
  points_.clear();
  const int step = std::max(
      1, static_cast<int>(std::ceil(std::sqrt(static_cast<double>(depth_m.total()) / kMost))));
  for (int y = step / 2; y < depth_m.rows; y += step) {
    for (int x = step / 2; x < depth_m.cols && points_.size() < kMost; x += step) {
      const float depth = depth_m.at<float>(y, x);
      if (!(depth > 0)) continue;
      const int left = std::max(0, x - kFacingReach);
      const int right = std::min(depth_m.cols - 1, x + kFacingReach);
      const int upper = std::max(0, y - kFacingReach);
      const int lower = std::min(depth_m.rows - 1, y + kFacingReach);
      if (!IsEven(depth_m.at<float>(y, left), depth, depth_m.at<float>(y, right)) ||
          !IsEven(depth_m.at<float>(upper, x), depth, depth_m.at<float>(lower, x))) {
        continue;
      }
      const Eigen::Vector3f across =
          SurfaceAt(depth_m, camera, right, y) - SurfaceAt(depth_m, camera, left, y);
      const Eigen::Vector3f down =
          SurfaceAt(depth_m, camera, x, lower) - SurfaceAt(depth_m, camera, x, upper);
      const Eigen::Vector3f outward = down.cross(across);
      if (!(outward.norm() > 0)) continue;
      const Eigen::Vector3f place = SurfaceAt(depth_m, camera, x, y);
      const Eigen::Vector3f facing = outward.normalized() / SurfaceErrorAt(depth);
      SurfacePoint point;
      point.place = place;
      point.row.head<3>() = facing;
      point.row.tail<3>() = place.cross(facing);
      points_.push_back(point);
    }
  }
}

void SurfacePoints::Measure(const MeasuredDepth& measured,
                            const Eigen::Isometry3d& new_from_reference, std::size_t every,
                            SurfaceDistances& distances) const {
  distances.Clear();
  const RgbdFrame& frame = *measured.frame;
  if (frame.depth.empty()) return;
  const FrameDepth depth(frame);
  const geo::CameraIntrinsics& camera = *measured.camera;
  const Eigen::Isometry3f motion(new_from_reference.cast<float>());
  const Eigen::Isometry3f back(new_from_reference.inverse().cast<float>());
  const auto fx = static_cast<float>(camera.fx), fy = static_cast<float>(camera.fy);
  const auto cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
  const float per_fx = 1 / fx, per_fy = 1 / fy;
  const auto most_u = static_cast<float>(frame.depth.cols) - 0.5F;
  const auto most_v = static_cast<float>(frame.depth.rows) - 0.5F;
  const auto distance_of = [&](const SurfacePoint& point) {
    const Eigen::Vector3f seen = motion * point.place;
    if (!(seen.z() > 0)) return kNothing;
    const float per_depth = 1 / seen.z();
    const float u = fx * seen.x() * per_depth + cx, v = fy * seen.y() * per_depth + cy;
    if (!(u >= 0 && v >= 0 && u < most_u && v < most_v)) return kNothing;
    const int x = static_cast<int>(u + 0.5F), y = static_cast<int>(v + 0.5F);
    const float found = depth.At(x, y);
    if (!(found >= measured.range.min_m && found <= measured.range.max_m)) return kNothing;
    const Eigen::Vector3f there((static_cast<float>(x) - cx) * per_fx * found,
                                (static_cast<float>(y) - cy) * per_fy * found, found);
    return point.row.head<3>().dot(back * there - point.place);
  };
  for (std::size_t i = 0; i < points_.size(); i += every) distances.Add(distance_of(points_[i]));
  if (every * distances.measured() < kSurfaceMinMeasured) distances.Clear();
}

std::optional<double> SurfacePoints::Agreement(const MeasuredDepth& depth,
                                               const Eigen::Isometry3d& new_from_reference,
                                               double bound) const {
  SurfaceDistances distances;
  Measure(depth, new_from_reference, 1, distances);
  if (distances.measured() == 0) return std::nullopt;
  return distances.ShareWithin(bound);
}

std::optional<Eigen::Isometry3d> SurfacePoints::NewFromReference(
    const MeasuredDepth& depth, const Eigen::Isometry3d& start) const {
  constexpr int kIterations = 10;
  constexpr std::size_t kEvery = SurfacesEvery(false);
  constexpr double kFirstBound = 3 * kOtherSurface, kNarrower = 0.7;
  constexpr double kDamping = 1e-3;   // Of what the points know most of.
  constexpr double kLastStep = 1e-3;  // m, rad.
  Eigen::Isometry3d motion = start;
  double bound = kFirstBound;
  SurfaceDistances distances;
  for (int i = 0; i < kIterations; ++i) {
    Measure(depth, motion, kEvery, distances);
    if (distances.measured() == 0) return std::nullopt;
    Matrix6d normal = Matrix6d::Zero();
    Vector6d gradient = Vector6d::Zero();
    for (std::size_t k = 0; k < distances.size(); ++k) {
      if (!(std::abs(distances[k]) < bound)) continue;
      const Vector6d row = Jacobian(k * kEvery).cast<double>();
      normal.noalias() += row * row.transpose();
      gradient -= static_cast<double>(distances[k]) * row;
    }
    for (const int block : {0, 3}) {  // Metres, radians.
      auto diagonal = normal.diagonal().segment<3>(block).array();
      diagonal += kDamping * diagonal.maxCoeff();
    }
    const Vector6d step = normal.ldlt().solve(gradient);
    if (!step.allFinite()) return std::nullopt;
    motion = Renormalised(motion * Se3Exp(-step));
    if (bound == kOtherSurface && step.norm() < kLastStep) break;
    bound = std::max<double>(kOtherSurface, kNarrower * bound);
  }
  return motion;
}

std::optional<double> SurfaceConstraint::Agreement(const Eigen::Isometry3d& new_from_reference,
                                                   double bound) const {
  if (points == nullptr) return std::nullopt;
  return points->Agreement(depth, new_from_reference, bound);
}

double SurfaceBound(double least_sigma) {
  constexpr double kSigmas = 4, kLeast = 0.1;
  return std::clamp(kSigmas * least_sigma, kLeast, 1.0);
}

}  // namespace livemap::odometry
