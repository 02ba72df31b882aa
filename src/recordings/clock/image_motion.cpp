#include "recordings/clock/image_motion.h"

#include <Eigen/Core>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "common/time.h"

namespace livemap::recordings {
namespace {

constexpr int kCornersPerCell = 12;
constexpr int kCellColumns = 4;
constexpr int kCellRows = 3;
constexpr std::size_t kMinCorners = 16;
/// The lowest part shows the bonnet and the road close ahead.
constexpr double kUsedHeight = 0.8;
/// Of that, where the far field is.
constexpr double kFarHeight = 0.62;
constexpr int kPasses = 8;

/// A followed corner: where it was from the middle, and how it moved; in image widths.
struct FollowedCorner {
  double x, y, dx, dy;
};

/// The best corners of every cell, so that one house does not outvote the street.
std::vector<cv::Point2f> CornersOf(const cv::Mat& grey) {
  std::vector<cv::Point2f> corners, found;
  const int height = static_cast<int>(grey.rows * kUsedHeight);
  for (int row = 0; row < kCellRows; ++row) {
    for (int column = 0; column < kCellColumns; ++column) {
      const int x = grey.cols * column / kCellColumns, y = height * row / kCellRows;
      const cv::Rect cell(x, y, grey.cols * (column + 1) / kCellColumns - x,
                          height * (row + 1) / kCellRows - y);
      cv::goodFeaturesToTrack(grey(cell), found, kCornersPerCell, 0.02, 5);
      for (const cv::Point2f& corner : found) {
        corners.emplace_back(corner.x + static_cast<float>(x), corner.y + static_cast<float>(y));
      }
    }
  }
  return corners;
}

std::vector<FollowedCorner> Follow(const cv::Mat& from, const cv::Mat& to) {
  const std::vector<cv::Point2f> corners = CornersOf(from);
  std::vector<FollowedCorner> followed;
  if (corners.size() < kMinCorners) return followed;
  std::vector<cv::Point2f> moved;
  std::vector<unsigned char> status;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(from, to, corners, moved, status, error, cv::Size(15, 15), 3);
  const double width = from.cols;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const cv::Point2f end = moved[i];
    if (status[i] == 0 || end.x < 1 || end.y < 1 || end.x > static_cast<float>(to.cols - 2) ||
        end.y > static_cast<float>(to.rows - 2)) {
      continue;
    }
    followed.push_back({(corners[i].x - width / 2) / width, corners[i].y / width,
                        (end.x - corners[i].x) / width, (end.y - corners[i].y) / width});
  }
  return followed;
}

double MedianOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The horizontal motion that is the same everywhere: `a` of dx = a + b x- + c x+ by Tukey's
/// weights.
std::optional<double> CommonMotion(const std::vector<FollowedCorner>& corners, double max_y) {
  std::vector<FollowedCorner> far;
  for (const FollowedCorner& corner : corners) {
    if (corner.y < max_y) far.push_back(corner);
  }
  if (far.size() < kMinCorners) return std::nullopt;
  Eigen::Vector3d model = Eigen::Vector3d::Zero();
  std::vector<double> residuals(far.size()), sizes(far.size());
  for (int pass = 0; pass < kPasses; ++pass) {
    for (std::size_t i = 0; i < far.size(); ++i) {
      const Eigen::Vector3d row(1, std::min(far[i].x, 0.0), std::max(far[i].x, 0.0));
      residuals[i] = far[i].dx - row.dot(model);
      sizes[i] = std::abs(residuals[i]);
    }
    // From everything to what agrees.
    const double scale = std::max(1e-4, 1.48 * MedianOf(sizes)) * (pass < 2 ? 10 : 4);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Identity() * 1e-6;
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < far.size(); ++i) {
      const double ratio = residuals[i] / scale;
      if (std::abs(ratio) >= 1) continue;
      const double weight = std::pow(1 - ratio * ratio, 2);
      const Eigen::Vector3d row(1, std::min(far[i].x, 0.0), std::max(far[i].x, 0.0));
      normal += weight * row * row.transpose();
      right += weight * row * far[i].dx;
    }
    model = normal.ldlt().solve(right);
  }
  return model[0];
}

}  // namespace

bool ImageMotionMeter::Wants(std::int64_t stamp_ns) const {
  return before_.empty() || Seconds(stamp_ns - before_ns_) >= kMinStepS;
}

std::optional<ImageMotion> ImageMotionMeter::Add(const cv::Mat& grey, std::int64_t stamp_ns) {
  if (!Wants(stamp_ns)) return std::nullopt;
  const cv::Mat before = before_;
  const std::int64_t before_ns = before_ns_;
  before_ = grey;
  before_ns_ = stamp_ns;
  const double step_s = Seconds(stamp_ns - before_ns);
  if (before.empty() || before.size() != grey.size() || step_s > kMaxStepS) return std::nullopt;
  const std::vector<FollowedCorner> corners = Follow(before, grey);
  if (corners.size() < kMinCorners) return std::nullopt;
  const double far_y = kFarHeight * grey.rows / grey.cols;
  const std::optional<double> common = CommonMotion(corners, far_y);
  if (!common) return std::nullopt;
  std::vector<double> speeds;
  speeds.reserve(corners.size());
  for (const FollowedCorner& corner : corners) {
    speeds.push_back(std::hypot(corner.dx - *common, corner.dy));
  }
  return ImageMotion{before_ns + (stamp_ns - before_ns) / 2, -*common / step_s,
                     MedianOf(std::move(speeds)) / step_s};
}

}  // namespace livemap::recordings
