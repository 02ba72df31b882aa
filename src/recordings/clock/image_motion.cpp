#include "recordings/clock/image_motion.h"

#include <Eigen/Core>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "common/median.h"
#include "common/time.h"

namespace livemap::recordings {
namespace {

constexpr int kCornersPerCell = 12;
constexpr int kCellColumns = 4;
constexpr int kCellRows = 3;
constexpr std::size_t kMinCorners = 16;
/// The lowest part shows the bonnet and the road close ahead.
constexpr double kUsedHeight = 0.8;
constexpr int kPasses = 10;
/// A corner that does not come back to where it was, pixels, was not followed.
constexpr float kBackPixels = 0.5F;

/// A followed corner: where it was from the middle, and how it moved; in image widths.
struct FollowedCorner {
  Eigen::Vector2d place, motion;

  /// The motion per radian of rotation about the optical frame's axes, a column each.
  Eigen::Matrix<double, 2, 3> PerRotation() const {
    constexpr double f = ImageMotionMeter::kFocal;
    const double x = place.x() / f, y = place.y() / f;
    Eigen::Matrix<double, 2, 3> columns;
    columns << x * y, -(1 + x * x), y,  //
        1 + y * y, -x * y, -x;
    return f * columns;
  }
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
  std::vector<cv::Point2f> moved, returned;
  std::vector<unsigned char> there, back;
  std::vector<float> error;
  const cv::Size window(15, 15);
  cv::calcOpticalFlowPyrLK(from, to, corners, moved, there, error, window, 3);
  cv::calcOpticalFlowPyrLK(to, from, moved, returned, back, error, window, 3);
  const double width = from.cols;
  const cv::Point2f middle(static_cast<float>(from.cols) / 2, static_cast<float>(from.rows) / 2);
  const cv::Rect2f inside(1, 1, static_cast<float>(to.cols - 3), static_cast<float>(to.rows - 3));
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const cv::Point2f missed = returned[i] - corners[i];
    if (there[i] == 0 || back[i] == 0 || !inside.contains(moved[i]) ||
        std::hypot(missed.x, missed.y) > kBackPixels) {
      continue;
    }
    const cv::Point2f place = corners[i] - middle, motion = moved[i] - corners[i];
    followed.push_back(
        {Eigen::Vector2d(place.x, place.y) / width, Eigen::Vector2d(motion.x, motion.y) / width});
  }
  return followed;
}

/// The rotation that explains how corners moved across their direction from the middle.
Eigen::Vector3d RotationOf(const std::vector<FollowedCorner>& corners) {
  const auto count = static_cast<Eigen::Index>(corners.size());
  Eigen::MatrixX3d rows(count, 3);
  Eigen::VectorXd across(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const FollowedCorner& corner = corners[static_cast<std::size_t>(i)];
    const Eigen::Vector2d normal =
        Eigen::Vector2d(-corner.place.y(), corner.place.x()) / (corner.place.norm() + 1e-3);
    rows.row(i) = normal.transpose() * corner.PerRotation();
    across[i] = normal.dot(corner.motion);
  }
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(count);
  for (int pass = 0; pass < kPasses; ++pass) {
    const Eigen::Matrix3d normal =
        rows.transpose() * weights.asDiagonal() * rows + Eigen::Matrix3d::Identity() * 1e-4;
    rotation = normal.ldlt().solve(rows.transpose() * (weights.asDiagonal() * across));
    const Eigen::VectorXd residuals = across - rows * rotation;
    std::vector<double> sizes(static_cast<std::size_t>(count));
    Eigen::VectorXd::Map(sizes.data(), count) = residuals.cwiseAbs();
    // From nearly everything to what agrees.
    const double scale =
        std::max(3e-4, kMedianToSigma * MedianOf(std::move(sizes))) * (pass < 3 ? 6 : 3.5);
    weights = (1 - (residuals / scale).array().square()).max(0).square();
  }
  return rotation;
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
  const Eigen::Vector3d rotation = RotationOf(corners);
  std::vector<double> speeds;
  speeds.reserve(corners.size());
  for (const FollowedCorner& corner : corners) {
    speeds.push_back((corner.motion - corner.PerRotation() * rotation).norm());
  }
  return ImageMotion{before_ns + (stamp_ns - before_ns) / 2, rotation.y() / step_s,
                     MedianOf(std::move(speeds)) / step_s};
}

}  // namespace livemap::recordings
