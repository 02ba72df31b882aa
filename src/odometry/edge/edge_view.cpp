#include "odometry/edge/edge_view.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace livemap::odometry {
namespace {

/// Hue from red at half the mean depth to blue at twice it.
cv::Vec3b EdgeDepthColour(double depth_m, double mean_inverse_depth) {
  const double share = std::clamp(0.5 + 0.5 * std::log2(depth_m * mean_inverse_depth), 0.0, 1.0);
  const double red = std::clamp(2 - 3 * share, 0.0, 1.0);
  const double green = std::clamp(1 - std::abs(2 * share - 1), 0.0, 1.0);
  const double blue = std::clamp(3 * share - 1, 0.0, 1.0);
  return {cv::saturate_cast<std::uint8_t>(255 * blue), cv::saturate_cast<std::uint8_t>(255 * green),
          cv::saturate_cast<std::uint8_t>(255 * red)};
}

}  // namespace

cv::Mat DrawEdges(const cv::Mat& grey, const Keyframe& keyframe,
                  const Eigen::Isometry3d& camera_from_keyframe,
                  const geo::CameraIntrinsics& intrinsics) {
  cv::Mat picture;
  cv::cvtColor(grey / 2, picture, cv::COLOR_GRAY2BGR);
  const EdgePoints& points = keyframe.finest_points();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d point =
        camera_from_keyframe *
        Eigen::Vector3f(points.x[i], points.y[i], points.z[i]).cast<double>();
    if (point.z() <= 0) continue;
    const double u = intrinsics.fx * point.x() / point.z() + intrinsics.cx;
    const double v = intrinsics.fy * point.y() / point.z() + intrinsics.cy;
    if (!(u > -0.5 && v > -0.5 && u < picture.cols - 0.5 && v < picture.rows - 0.5)) continue;
    picture.at<cv::Vec3b>(static_cast<int>(std::lround(v)), static_cast<int>(std::lround(u))) =
        EdgeDepthColour(point.z(), points.mean_inverse_depth);
  }
  return picture;
}

}  // namespace livemap::odometry
