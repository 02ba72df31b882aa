#include "placement/depth_ground_contact.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/median.h"
#include "placement/road_ground_contact.h"

namespace livemap::placement {
namespace {

constexpr double kBandShare = 0.15;  // Of the box's height that is its foot.
constexpr int kMinBandRows = 2;
constexpr double kMinKnownShare = 0.3;  // Of the foot's pixels.
constexpr std::size_t kMinKnown = 6;
constexpr double kMaxScatter = 0.1;   // Of the depth.
constexpr double kMaxOffRoadM = 0.5;  // Above or below the road's plane, nearby,
constexpr double kMaxSlope = 0.12;    // and per metre of distance: roads climb.

struct Statistics {
  double median_m = 0;
  double sigma_m = 0;  // Robust.
};

/// NaN where it is unknown.
double ContactDepthAt(const DepthImage& image, int row, int column) {
  if (image.depth.type() == CV_32FC1) return image.depth.at<float>(row, column);
  return image.depth.at<std::uint16_t>(row, column) / image.units_per_m;
}

/// Over some pixels of the image; none where too few have a depth.
std::optional<Statistics> MeasureContactDepth(const DepthImage& image, const cv::Rect& pixels,
                                              const DepthNoise& noise) {
  const cv::Rect inside = pixels & cv::Rect(0, 0, image.depth.cols, image.depth.rows);
  std::vector<double> depths_m;
  for (int row = inside.y; row < inside.br().y; ++row) {
    for (int column = inside.x; column < inside.br().x; ++column) {
      const double depth_m = ContactDepthAt(image, row, column);
      if (depth_m >= noise.min_m && depth_m <= noise.max_m) depths_m.push_back(depth_m);
    }
  }
  const double known = static_cast<double>(depths_m.size());
  if (depths_m.size() < kMinKnown || known < kMinKnownShare * inside.area()) return std::nullopt;
  Statistics statistics;
  statistics.median_m = TakeMedian(depths_m);
  for (double& depth_m : depths_m) depth_m = std::abs(depth_m - statistics.median_m);
  statistics.sigma_m = kMedianToSigma * TakeMedian(depths_m);
  return statistics;
}

/// Rows of the foot, and its depth.
struct Foot {
  Statistics depth;
  double slope_m_per_px = 0;  // How the depth changes from row to row.
};

std::optional<Foot> MeasureContactFoot(const DepthImage& image, const imaging::Box& box,
                                       const DepthNoise& noise) {
  // Box edges count from the first pixel's outer corner.
  const int left = static_cast<int>(std::floor(0.75 * box.x_min + 0.25 * box.x_max));
  const int right = static_cast<int>(std::ceil(0.25 * box.x_min + 0.75 * box.x_max));
  const int bottom = static_cast<int>(std::round(box.y_max));
  const int rows =
      std::max(kMinBandRows, static_cast<int>(std::round(kBandShare * (box.y_max - box.y_min))));
  const auto band = [&](int end) { return cv::Rect(left, end - rows, right - left, rows); };
  const auto low = MeasureContactDepth(image, band(bottom), noise);
  if (!low || low->sigma_m > kMaxScatter * low->median_m) return std::nullopt;
  Foot foot{*low};
  // On the road the rows above are further away, on a standing thing they are not.
  const auto above = MeasureContactDepth(image, band(bottom - rows), noise);
  if (above) foot.slope_m_per_px = std::abs(above->median_m - low->median_m) / rows;
  return foot;
}

bool DepthFitsContact(const DepthImage& image, const imaging::Box& box,
                      const geo::CameraIntrinsics& camera) {
  const bool is_depth = image.depth.type() == CV_32FC1 || image.depth.type() == CV_16UC1;
  // A box may hang over the image's edge, but not by more than its size.
  const double most = 2.0 * std::max(image.depth.cols, image.depth.rows);
  return is_depth && image.depth.cols == camera.width && image.depth.rows == camera.height &&
         image.units_per_m > 0 && camera.fx > 0 && camera.fy > 0 && box.x_min > -most &&
         box.x_max < most && box.y_min > -most && box.y_max < most && box.x_min < box.x_max &&
         box.y_min < box.y_max;
}

}  // namespace

std::optional<geo::GroundPoint> ContactByDepth(const DepthImage& image, const imaging::Box& box,
                                               const geo::CameraIntrinsics& intrinsics,
                                               const Eigen::Isometry3d& base_from_optical,
                                               const geo::GroundProjectionNoise& noise,
                                               const DepthNoise& depth_noise) {
  if (!DepthFitsContact(image, box, intrinsics) || !base_from_optical.matrix().allFinite())
    return std::nullopt;
  const auto foot = MeasureContactFoot(image, box, depth_noise);
  if (!foot) return std::nullopt;
  const double depth_m = foot->depth.median_m;
  const Eigen::Vector2d pixel = ContactPixel(box);
  const Eigen::Matrix3d rotation = base_from_optical.linear();
  const Eigen::Vector3d direction =
      rotation * Eigen::Vector3d((pixel.x() - intrinsics.cx) / intrinsics.fx,
                                 (pixel.y() - intrinsics.cy) / intrinsics.fy, 1.0);
  const Eigen::Vector3d from_camera_m = depth_m * direction;
  const Eigen::Vector3d point_m = base_from_optical.translation() + from_camera_m;
  const double distance_m = from_camera_m.head<2>().norm();
  if (std::abs(point_m.z()) > kMaxOffRoadM + kMaxSlope * distance_m) return std::nullopt;

  const double depth_sigma_m =
      std::hypot(foot->depth.sigma_m, foot->slope_m_per_px * noise.pixel_sigma_px,
                 depth_noise.sigma_share * depth_m);
  // Columns: pixel u, depth, pitch; each times its standard deviation.
  Eigen::Matrix<double, 2, 3> weighted;
  weighted.col(0) = rotation.col(0).head<2>() * (depth_m / intrinsics.fx * noise.pixel_sigma_px);
  weighted.col(1) = direction.head<2>() * depth_sigma_m;
  weighted.col(2) = Eigen::Vector3d::UnitY().cross(from_camera_m).head<2>() * noise.pitch_sigma_rad;
  geo::GroundPoint point;
  point.position_m = point_m.head<2>();
  point.covariance_m2 = weighted * weighted.transpose();
  return point;
}

}  // namespace livemap::placement
