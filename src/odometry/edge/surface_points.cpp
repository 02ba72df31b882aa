#include "odometry/edge/surface_points.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace livemap::odometry {
namespace {

/// A depth camera errs by a share of the depth, and that share grows with it (disparities).
constexpr float kSurfaceError = 0.015F;
constexpr float kSurfaceErrorPerM = 0.004F;
/// Fewer measurements than this say nothing.
constexpr std::size_t kSurfaceMinMeasured = 60;
/// How far to either side a point looks for the way its surface faces, pixels of the coarsest
/// level: the noise of a depth camera tilts what is nearer.
constexpr int kFacingReach = 3;
constexpr double kMedianToSigmaOfSurfaces = 1.4826;

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

/// Whether the pixels of a depth image to either side of one lie on one surface with it. Inverse
/// depths of a plane are linear in the image.
bool IsEven(float before, float here, float behind) {
  if (!(before > 0 && behind > 0)) return false;
  return std::abs(0.5F * (1 / before + 1 / behind) - 1 / here) * here * here < SurfaceErrorAt(here);
}

/// A frame's depth in metres at a pixel; not positive where it is unknown.
class FrameDepth {
 public:
  FrameDepth(const RgbdFrame& frame)
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

void SurfacePoints::Take(const cv::Mat& depth_m, const geo::CameraIntrinsics& camera) {
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
      const Eigen::Vector3f facing = down.cross(across).normalized();
      if (!facing.allFinite()) continue;
      points_.push_back({SurfaceAt(depth_m, camera, x, y), facing, 1 / SurfaceErrorAt(depth)});
    }
  }
}

void SurfacePoints::Measure(const RgbdFrame& frame, const geo::CameraIntrinsics& camera,
                            const Eigen::Isometry3d& new_from_reference, std::size_t every,
                            Distances& distances) const {
  distances.Clear();
  if (frame.depth.empty()) return;
  const FrameDepth depth(frame);
  const Eigen::Isometry3f motion(new_from_reference.cast<float>());
  const Eigen::Isometry3f back(new_from_reference.inverse().cast<float>());
  const auto fx = static_cast<float>(camera.fx), fy = static_cast<float>(camera.fy);
  const auto cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
  const auto most_u = static_cast<float>(frame.depth.cols) - 0.5F;
  const auto most_v = static_cast<float>(frame.depth.rows) - 0.5F;
  const auto distance_of = [&](const SurfacePoint& point) {
    const Eigen::Vector3f seen = motion * point.place;
    if (!(seen.z() > 0)) return kNothing;
    const float u = fx * seen.x() / seen.z() + cx, v = fy * seen.y() / seen.z() + cy;
    if (!(u >= 0 && v >= 0 && u < most_u && v < most_v)) return kNothing;
    const int x = static_cast<int>(u + 0.5F), y = static_cast<int>(v + 0.5F);
    const float found = depth.At(x, y);
    if (!(found > 0) || !std::isfinite(found)) return kNothing;
    const Eigen::Vector3f there((static_cast<float>(x) - cx) / fx * found,
                                (static_cast<float>(y) - cy) / fy * found, found);
    return point.facing.dot(back * there - point.place) * point.per_error;
  };
  for (std::size_t i = 0; i < points_.size(); i += every) distances.Add(distance_of(points_[i]));
}

double SurfacePoints::Distances::Sigma() const {
  std::array<float, kMost> magnitudes;
  std::size_t measured = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    if (!std::isnan(values_[i])) magnitudes[measured++] = std::abs(values_[i]);
  }
  if (measured == 0) return std::numeric_limits<double>::infinity();
  float* const median = magnitudes.data() + measured / 2;
  std::nth_element(magnitudes.data(), median, magnitudes.data() + measured);
  return kMedianToSigmaOfSurfaces * static_cast<double>(*median);
}

std::size_t SurfacePoints::Distances::CountMeasured() const {
  return static_cast<std::size_t>(
      std::count_if(values_.begin(), values_.begin() + static_cast<std::ptrdiff_t>(count_),
                    [](float distance) { return !std::isnan(distance); }));
}

double SurfacePoints::Distances::ShareWithin(double bound) const {
  std::size_t within = 0;
  for (std::size_t i = 0; i < count_; ++i) within += std::abs(values_[i]) < bound ? 1U : 0U;
  return static_cast<double>(within) / static_cast<double>(CountMeasured());
}

Eigen::Matrix<float, 6, 1> SurfacePoints::Jacobian(std::size_t index) const {
  const SurfacePoint& point = points_[index];
  Eigen::Matrix<float, 6, 1> jacobian;
  jacobian << point.facing, point.place.cross(point.facing);
  return point.per_error * jacobian;
}

std::optional<double> SurfacePoints::Agreement(const RgbdFrame& frame,
                                               const geo::CameraIntrinsics& camera,
                                               const Eigen::Isometry3d& new_from_reference,
                                               double bound) const {
  Distances distances;
  Measure(frame, camera, new_from_reference, 1, distances);
  if (distances.CountMeasured() < kSurfaceMinMeasured) return std::nullopt;
  return distances.ShareWithin(bound);
}

std::optional<double> SurfaceConstraint::Agreement(const Eigen::Isometry3d& new_from_reference,
                                                   double bound) const {
  if (points == nullptr) return std::nullopt;
  return points->Agreement(*frame, *camera, new_from_reference, bound);
}

double SurfaceConstraint::Sigma(const Eigen::Isometry3d& new_from_reference) const {
  if (points == nullptr) return std::numeric_limits<double>::infinity();
  SurfacePoints::Distances distances;
  points->Measure(*frame, *camera, new_from_reference, 2, distances);
  return distances.Sigma();
}

double SurfaceBound(double least_sigma) {
  constexpr double kSigmas = 4, kLeast = 0.1;
  return std::clamp(kSigmas * least_sigma, kLeast, 1.0);
}

std::optional<Eigen::Isometry3d> SurfacePoints::NewFromReference(
    const RgbdFrame& frame, const geo::CameraIntrinsics& camera,
    const Eigen::Isometry3d& start) const {
  constexpr int kIterations = 10;
  constexpr std::size_t kEvery = 2;
  constexpr double kFirstBound = 3 * kOtherSurface, kNarrower = 0.7;
  constexpr double kDamping = 1e-3;  // Of what the points know most of.
  Eigen::Isometry3d motion = start;
  double bound = kFirstBound;
  Distances distances;
  for (int i = 0; i < kIterations; ++i) {
    Measure(frame, camera, motion, kEvery, distances);
    if (kEvery * distances.CountMeasured() < kSurfaceMinMeasured) return std::nullopt;
    Matrix6d normal = Matrix6d::Zero();
    Vector6d gradient = Vector6d::Zero();
    for (std::size_t k = 0; k < distances.size(); ++k) {
      if (!(std::abs(distances[k]) < bound)) continue;
      const Vector6d jacobian = Jacobian(k * kEvery).cast<double>();
      normal += jacobian * jacobian.transpose();
      gradient -= static_cast<double>(distances[k]) * jacobian;
    }
    normal.diagonal().array() += kDamping * normal.diagonal().maxCoeff();
    const Vector6d step = normal.ldlt().solve(gradient);
    if (!step.allFinite()) return std::nullopt;
    motion = Renormalised(motion * Se3Exp(-step));
    bound = std::max<double>(kOtherSurface, kNarrower * bound);
  }
  return motion;
}

}  // namespace livemap::odometry
