#include "change/registration/warp.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "change/registration/depth_image.h"

namespace livemap::change {
namespace {

/// Places of the later view's pixels in the earlier one.
struct Places {
  cv::Mat column;  ///< CV_32FC1; NaN: not known.
  cv::Mat row;
  cv::Mat distance;  ///< Along the earlier camera's axis, metres.
};

Places WarpedPlacesInBefore(const cv::Mat& after_depth, const geo::CameraIntrinsics& after_camera,
                            const geo::CameraIntrinsics& before_camera,
                            const Eigen::Isometry3d& before_from_after) {
  constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
  Places places;
  for (cv::Mat* image : {&places.column, &places.row, &places.distance}) {
    *image = cv::Mat(after_depth.size(), CV_32FC1, cv::Scalar(kUnknown));
  }
  for (int row = 0; row < after_depth.rows; ++row) {
    for (int column = 0; column < after_depth.cols; ++column) {
      const double z = static_cast<double>(after_depth.at<float>(row, column));
      if (!(z > 0) || !std::isfinite(z)) continue;
      const Eigen::Vector3d point =
          before_from_after * Eigen::Vector3d((column - after_camera.cx) / after_camera.fx * z,
                                              (row - after_camera.cy) / after_camera.fy * z, z);
      if (!(point.z() > 0.05)) continue;
      places.column.at<float>(row, column) =
          static_cast<float>(before_camera.fx * point.x() / point.z() + before_camera.cx);
      places.row.at<float>(row, column) =
          static_cast<float>(before_camera.fy * point.y() / point.z() + before_camera.cy);
      places.distance.at<float>(row, column) = static_cast<float>(point.z());
    }
  }
  return places;
}

bool IsWarpedWithin(float column, float row, cv::Size size) {
  return column >= 0 && row >= 0 && column <= static_cast<float>(size.width - 1) &&
         row <= static_cast<float>(size.height - 1);
}

/// Distance of the nearest thing per pixel of the earlier view. Each place is spread over the four
/// pixels around it, so that a surface seen larger there has no holes up to twice the size.
cv::Mat DepthBufferForWarp(const Places& places, cv::Size size) {
  cv::Mat buffer(size, CV_32FC1, cv::Scalar(std::numeric_limits<float>::max()));
  for (int row = 0; row < places.row.rows; ++row) {
    for (int column = 0; column < places.row.cols; ++column) {
      const float x = places.column.at<float>(row, column);
      const float y = places.row.at<float>(row, column);
      if (!IsWarpedWithin(x, y, size)) continue;
      const int left = static_cast<int>(x);
      const int top = static_cast<int>(y);
      for (int v = top; v <= std::min(top + 1, size.height - 1); ++v) {
        for (int u = left; u <= std::min(left + 1, size.width - 1); ++u) {
          float& nearest = buffer.at<float>(v, u);
          nearest = std::min(nearest, places.distance.at<float>(row, column));
        }
      }
    }
  }
  return buffer;
}

}  // namespace

double WarpedPicture::ValidShare() const {
  return static_cast<double>(cv::countNonZero(valid)) / static_cast<double>(valid.total());
}

WarpedPicture WarpByHomography(const cv::Mat& before, const cv::Matx33d& after_from_before) {
  WarpedPicture warped;
  cv::warpPerspective(before, warped.picture, after_from_before, before.size(), cv::INTER_LINEAR);
  const cv::Mat full(before.size(), CV_8UC1, cv::Scalar(255));
  cv::warpPerspective(full, warped.valid, after_from_before, before.size(), cv::INTER_LINEAR);
  // At the border the picture is mixed with black.
  warped.valid = warped.valid == 255;
  warped.picture.setTo(cv::Scalar::all(0), warped.valid == 0);
  return warped;
}

WarpedPicture WarpByDepth(const cv::Mat& before, const geo::CameraIntrinsics& before_camera,
                          const cv::Mat& after_depth, const geo::CameraIntrinsics& after_camera,
                          const Eigen::Isometry3d& before_from_after,
                          const DepthWarpConfig& options) {
  CheckDepthImage(after_depth, cv::Size(after_camera.width, after_camera.height));
  const Places places =
      WarpedPlacesInBefore(after_depth, after_camera, before_camera, before_from_after);
  const cv::Mat buffer = DepthBufferForWarp(places, before.size());
  WarpedPicture warped;
  warped.valid = cv::Mat::zeros(after_depth.size(), CV_8UC1);
  for (int row = 0; row < after_depth.rows; ++row) {
    for (int column = 0; column < after_depth.cols; ++column) {
      const float x = places.column.at<float>(row, column);
      const float y = places.row.at<float>(row, column);
      if (!IsWarpedWithin(x, y, before.size())) continue;
      const auto nearest = static_cast<double>(
          buffer.at<float>(static_cast<int>(std::lround(y)), static_cast<int>(std::lround(x))));
      const auto distance = static_cast<double>(places.distance.at<float>(row, column));
      if (distance > nearest * (1 + options.occlusion_share) + options.occlusion_m) continue;
      warped.valid.at<std::uint8_t>(row, column) = 255;
    }
  }
  cv::Mat column = places.column;
  cv::Mat row = places.row;
  column.setTo(-1, warped.valid == 0);
  row.setTo(-1, warped.valid == 0);
  cv::remap(before, warped.picture, column, row, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  warped.picture.setTo(cv::Scalar::all(0), warped.valid == 0);
  return warped;
}

}  // namespace livemap::change
