#include "odometry/monocular/two_view_start.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "common/median.h"
#include "odometry/monocular/corner_motion.h"

namespace livemap::odometry {
namespace {

constexpr double kCornerQuality = 0.005;
constexpr double kCornerDistancePx = 8;
constexpr double kConfidence = 0.9999;

/// The 95 % quantile of chi-square with two degrees of freedom. If half of the corners are further
/// off, what the image contradicts is no noise.
constexpr double kChiSquare95 = 5.99;
/// So many images that agree verify a start of enough parallax; so many that do not refute one.
constexpr int kImagesThatTell = 2;
/// A baseline with so many times the parallax of the start's is worth its depths anew.
constexpr double kMuchLonger = 1.5;
/// A refuted start needs a baseline that is longer at all.
constexpr double kLonger = 1.2;

/// By how much a point moves over the image for each unit of its inverse depth, px.
Eigen::Vector2d LineOf(const Eigen::Vector3d& seen, const Eigen::Vector3d& translation,
                       double focal_px) {
  return focal_px / seen.z() * (translation.head<2>() - seen.hnormalized() * translation.z());
}

}  // namespace

TwoViewStart::TwoViewStart(const Config& config, const geo::CameraIntrinsics& camera)
    : config_(config), camera_(camera) {}

void TwoViewStart::Begin(const cv::Mat& grey) {
  grey.copyTo(first_);
  grey.copyTo(last_);
  cv::goodFeaturesToTrack(first_, begin_, config_.corners, kCornerQuality, kCornerDistancePx);
  second_ = end_ = begin_;
  just_begun_ = true;
  provisional_ = false;
}

void TwoViewStart::FollowCorners(const cv::Mat& grey) {
  if (end_.empty()) return;
  const FollowedCorners followed = odometry::FollowCorners(last_, grey, end_);
  KeepFollowed(followed.now, followed.found);
  grey.copyTo(last_);
}

std::optional<Eigen::Isometry3d> TwoViewStart::Follow(const cv::Mat& grey) {
  FollowCorners(grey);
  if (end_.size() < static_cast<std::size_t>(config_.min_corners)) {
    Begin(grey);
    return std::nullopt;
  }
  just_begun_ = false;
  if (MedianWayPx() < config_.min_way * camera_.width) return std::nullopt;
  std::optional<Eigen::Isometry3d> motion = Motion();
  if (motion) {
    TakePair(*motion);
  } else if (MedianWayPx() > config_.longest_way * camera_.width) {
    Begin(grey);
  }
  return motion;
}

/// The last image becomes the second one.
void TwoViewStart::TakePair(const Eigen::Isometry3d& second_from_first) {
  second_ = end_;
  second_from_first_ = second_from_first;
  parallax_px_ = MedianParallaxPx();
  agreeing_ = contradicting_ = 0;
  provisional_ = true;
}

/// Both ends of the parallax err.
double TwoViewStart::DepthSigma() const {
  return std::sqrt(2.0) * config_.pixel_sigma / parallax_px_;
}

TwoViewStart::Verdict TwoViewStart::Check(const cv::Mat& grey,
                                          const Eigen::Isometry3d& new_from_first) {
  FollowCorners(grey);
  if (end_.size() < static_cast<std::size_t>(config_.min_corners)) {
    provisional_ = false;
    return contradicting_ >= kImagesThatTell ? Verdict::kFails : Verdict::kHolds;
  }
  const double miss = MedianMiss(new_from_first);
  if (miss > kChiSquare95) {
    ++contradicting_;
  } else {
    ++agreeing_;
    contradicting_ = std::max(0, contradicting_ - 1);
  }
  const double parallax_px = MedianParallaxPx();
  const bool certain = DepthSigma() <= config_.enough_depth_sigma;
  if (contradicting_ >= kImagesThatTell && parallax_px > kLonger * parallax_px_) {
    return Verdict::kRemake;
  }
  if (!certain && parallax_px >= kMuchLonger * parallax_px_) return Verdict::kRemake;
  if (certain && agreeing_ >= kImagesThatTell && contradicting_ < kImagesThatTell) {
    provisional_ = false;
    return Verdict::kHolds;
  }
  return Verdict::kOpen;
}

std::optional<Eigen::Isometry3d> TwoViewStart::Remake() {
  const std::optional<Eigen::Isometry3d> motion = Motion();
  if (motion) TakePair(*motion);
  return motion;
}

/// How far the corners are from where the start's depths and this motion lead them: the median of
/// their squared distances over the covariance (Mahalanobis) that the noise of a pixel gives.
double TwoViewStart::MedianMiss(const Eigen::Isometry3d& new_from_first) const {
  const double focal_px = camera_.fx;
  const double variance = config_.pixel_sigma * config_.pixel_sigma;
  std::vector<double> misses;
  for (std::size_t i = 0; i < begin_.size(); ++i) {
    const Eigen::Vector3d first = RayOfCorner(begin_[i], camera_);
    const Eigen::Vector3d second = RayOfCorner(second_[i], camera_);
    // The inverse depth that brings the corner nearest to its place in the second image.
    const Eigen::Vector3d at_infinity = second_from_first_.linear() * first;
    const Eigen::Vector3d& move = second_from_first_.translation();
    const Eigen::Vector3d along = second.cross(move);
    const double inverse_depth = -along.dot(second.cross(at_infinity)) / along.squaredNorm();
    const Eigen::Vector2d second_line = LineOf(at_infinity + inverse_depth * move, move, focal_px);
    const Eigen::Vector3d seen =
        new_from_first.linear() * first + inverse_depth * new_from_first.translation();
    if (!(seen.z() > 0) || !std::isfinite(inverse_depth)) {
      misses.push_back(std::numeric_limits<double>::infinity());
      continue;
    }
    const Eigen::Vector2d miss =
        focal_px * (RayOfCorner(end_[i], camera_).hnormalized() - seen.hnormalized());
    const Eigen::Vector2d line = LineOf(seen, new_from_first.translation(), focal_px);
    const Eigen::Matrix2d covariance =
        2 * variance *
        (Eigen::Matrix2d::Identity() + line * line.transpose() / second_line.squaredNorm());
    misses.push_back(miss.dot(covariance.inverse() * miss));
  }
  return TakeMedian(misses);
}

void TwoViewStart::KeepFollowed(const std::vector<cv::Point2f>& now,
                                const std::vector<std::uint8_t>& found) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i] == 0) continue;
    begin_[kept] = begin_[i];
    second_[kept] = second_[i];
    end_[kept++] = now[i];
  }
  begin_.resize(kept);
  second_.resize(kept);
  end_.resize(kept);
}

double TwoViewStart::MedianWayPx() const {
  std::vector<double> ways;
  for (std::size_t i = 0; i < begin_.size(); ++i) {
    const cv::Point2f way = end_[i] - begin_[i];
    ways.push_back(std::hypot(way.x, way.y));
  }
  return TakeMedian(ways);
}

/// What the turn that explains the corners' ways best (Kabsch 1976, twice: the second time by those
/// that the first explains) leaves of them.
double TwoViewStart::MedianParallaxPx() const {
  std::vector<double> left(begin_.size(), 0.0);
  double limit_px = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 2; ++round) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < begin_.size(); ++i) {
      if (left[i] > limit_px) continue;
      sum += RayOfCorner(end_[i], camera_).normalized() *
             RayOfCorner(begin_[i], camera_).normalized().transpose();
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d handed = Eigen::Matrix3d::Identity();
    handed(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
    const Eigen::Matrix3d turn = svd.matrixU() * handed * svd.matrixV().transpose();
    for (std::size_t i = 0; i < begin_.size(); ++i) {
      const Eigen::Vector3d seen = turn * RayOfCorner(begin_[i], camera_);
      const Eigen::Vector3d now = RayOfCorner(end_[i], camera_);
      left[i] = camera_.fx * (seen.hnormalized() - now.hnormalized()).norm();
    }
    limit_px = MedianOf(left);
  }
  return limit_px;
}

std::optional<Eigen::Isometry3d> TwoViewStart::Motion() const {
  if (MedianParallaxPx() < config_.min_parallax * camera_.width) return std::nullopt;
  const cv::Matx33d k(camera_.fx, 0, camera_.cx, 0, camera_.fy, camera_.cy, 0, 0, 1);
  cv::Mat inliers;
  const cv::Mat essential = cv::findEssentialMat(begin_, end_, k, cv::USAC_MAGSAC, kConfidence,
                                                 config_.inlier_px, inliers);
  if (essential.rows != 3 || essential.cols != 3) return std::nullopt;
  cv::Matx33d rotation;
  cv::Vec3d translation;
  const int agree = cv::recoverPose(essential, begin_, end_, k, rotation, translation, inliers);
  if (agree < config_.min_corners ||
      agree < config_.min_inliers * static_cast<double>(begin_.size())) {
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
  RefineByCorners({begin_, end_}, camera_, config_.inlier_px, new_from_first);
  return new_from_first;
}

}  // namespace livemap::odometry
