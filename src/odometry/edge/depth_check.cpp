#include "odometry/edge/depth_check.h"

#include <algorithm>
#include <cmath>

namespace livemap::odometry {
namespace {

/// A depth camera errs by a share of the depth, and that share grows with it (disparities).
constexpr float kSurfaceError = 0.015F;
constexpr float kSurfaceErrorPerM = 0.004F;
/// Fewer measurements than this say nothing.
constexpr int kSurfaceMinMeasured = 60;

template <typename Depth>
void CountSurfaces(const std::vector<Eigen::Vector3f>& points, const cv::Mat& depth,
                   float m_per_unit, const geo::CameraIntrinsics& camera,
                   const Eigen::Isometry3f& new_from_reference, int& measured, int& agreeing) {
  const auto fx = static_cast<float>(camera.fx), fy = static_cast<float>(camera.fy);
  const auto cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
  const auto most_u = static_cast<float>(depth.cols) - 0.5F;
  const auto most_v = static_cast<float>(depth.rows) - 0.5F;
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3f seen = new_from_reference * point;
    if (!(seen.z() > 0)) continue;
    const float u = fx * seen.x() / seen.z() + cx, v = fy * seen.y() / seen.z() + cy;
    if (!(u >= 0 && v >= 0 && u < most_u && v < most_v)) continue;
    const float found = m_per_unit * static_cast<float>(depth.at<Depth>(
                                         static_cast<int>(v + 0.5F), static_cast<int>(u + 0.5F)));
    if (!(found > 0) || !std::isfinite(found)) continue;
    ++measured;
    const float bound = seen.z() * (kSurfaceError + kSurfaceErrorPerM * seen.z());
    if (std::abs(found - seen.z()) < bound) ++agreeing;
  }
}

}  // namespace

void SurfacePoints::Take(const cv::Mat& depth_m, const geo::CameraIntrinsics& camera) {
  points_.clear();
  const int step = std::max(
      1, static_cast<int>(std::ceil(std::sqrt(static_cast<double>(depth_m.total()) / kMost))));
  for (int y = step / 2; y < depth_m.rows; y += step) {
    const auto* row = depth_m.ptr<float>(y);
    for (int x = step / 2; x < depth_m.cols && points_.size() < kMost; x += step) {
      if (!(row[x] > 0)) continue;
      points_.emplace_back(static_cast<float>((x - camera.cx) / camera.fx) * row[x],
                           static_cast<float>((y - camera.cy) / camera.fy) * row[x], row[x]);
    }
  }
}

std::optional<double> SurfacePoints::Agreement(const RgbdFrame& frame,
                                               const geo::CameraIntrinsics& camera,
                                               const Eigen::Isometry3d& new_from_reference) const {
  if (frame.depth.empty()) return std::nullopt;
  int measured = 0, agreeing = 0;
  const Eigen::Isometry3f motion(new_from_reference.cast<float>());
  if (frame.depth.type() == CV_16UC1) {
    CountSurfaces<std::uint16_t>(points_, frame.depth,
                                 static_cast<float>(1 / frame.depth_units_per_m), camera, motion,
                                 measured, agreeing);
  } else {
    CountSurfaces<float>(points_, frame.depth, 1, camera, motion, measured, agreeing);
  }
  if (measured < kSurfaceMinMeasured) return std::nullopt;
  return static_cast<double>(agreeing) / measured;
}

}  // namespace livemap::odometry
