#include "edge_vo/two_view_start.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace livemap {
namespace {

constexpr double kCornerQuality = 0.005;
constexpr double kCornerDistancePx = 8;
constexpr float kThereAndBackPx = 1.0F;
constexpr double kConfidence = 0.9999;

}  // namespace

TwoViewStart::TwoViewStart(const Config& config, const CameraIntrinsics& camera)
    : config_(config), camera_(camera) {}

void TwoViewStart::Begin(const cv::Mat& grey) {
  grey.copyTo(first_);
  grey.copyTo(last_);
  cv::goodFeaturesToTrack(first_, begin_, config_.corners, kCornerQuality, kCornerDistancePx);
  end_ = begin_;
  just_begun_ = true;
}

std::optional<Eigen::Isometry3d> TwoViewStart::Follow(const cv::Mat& grey) {
  std::vector<cv::Point2f> now, back;
  std::vector<std::uint8_t> found, found_back;
  if (!end_.empty()) {
    std::vector<float> error;
    cv::calcOpticalFlowPyrLK(last_, grey, end_, now, found, error);
    cv::calcOpticalFlowPyrLK(grey, last_, now, back, found_back, error);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const cv::Point2f way = back[i] - end_[i];
      const bool same = std::hypot(way.x, way.y) <= kThereAndBackPx;
      found[i] = found[i] != 0 && found_back[i] != 0 && same ? 1 : 0;
    }
    KeepFollowed(now, found);
  }
  if (end_.size() < static_cast<std::size_t>(config_.least_corners)) {
    Begin(grey);
    return std::nullopt;
  }
  grey.copyTo(last_);
  just_begun_ = false;
  if (MedianWayPx() < config_.least_way * camera_.width) return std::nullopt;
  return Motion();
}

void TwoViewStart::KeepFollowed(const std::vector<cv::Point2f>& now,
                                const std::vector<std::uint8_t>& found) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i] == 0) continue;
    begin_[kept] = begin_[i];
    end_[kept++] = now[i];
  }
  begin_.resize(kept);
  end_.resize(kept);
}

double TwoViewStart::MedianWayPx() const {
  std::vector<double> ways;
  for (std::size_t i = 0; i < begin_.size(); ++i) {
    const cv::Point2f way = end_[i] - begin_[i];
    ways.push_back(std::hypot(way.x, way.y));
  }
  const auto middle = ways.begin() + static_cast<std::ptrdiff_t>(ways.size() / 2);
  std::nth_element(ways.begin(), middle, ways.end());
  return *middle;
}

std::optional<Eigen::Isometry3d> TwoViewStart::Motion() const {
  const cv::Matx33d k(camera_.fx, 0, camera_.cx, 0, camera_.fy, camera_.cy, 0, 0, 1);
  cv::Mat inliers;
  const cv::Mat essential = cv::findEssentialMat(begin_, end_, k, cv::USAC_MAGSAC, kConfidence,
                                                 config_.inlier_px, inliers);
  if (essential.rows != 3 || essential.cols != 3) return std::nullopt;
  cv::Matx33d rotation;
  cv::Vec3d translation;
  const int agree = cv::recoverPose(essential, begin_, end_, k, rotation, translation, inliers);
  if (agree < config_.least_corners ||
      agree < config_.least_inliers * static_cast<double>(begin_.size())) {
    return std::nullopt;
  }
  Eigen::Isometry3d new_from_first = Eigen::Isometry3d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      new_from_first.linear()(row, column) = rotation(row, column);
    }
    new_from_first.translation()[row] = translation[row];
  }
  if (!new_from_first.matrix().allFinite()) return std::nullopt;
  return new_from_first;
}

}  // namespace livemap
