#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "geo/camera_intrinsics.h"

namespace livemap::odometry {

/// The first motion of a single camera, before any depth is known: corners followed from a first
/// image on, and the essential matrix of their way (OpenCV: Shi-Tomasi, Lucas-Kanade, five points
/// in a RANSAC with a fixed seed), refined to the least Sampson error.
class TwoViewStart {
 public:
  struct Config {
    int corners = 1000;
    /// The corners' median way before a motion is looked for, share of the image's width.
    double min_way = 0.015;
    /// Corners that must be left, and their share that must agree.
    int min_corners = 60;
    double min_inliers = 0.6;
    /// Corners that went this far without a motion that they agree on: it begins anew, share of the
    /// image's width.
    double longest_way = 0.2;
    double inlier_px = 1.0;
    /// A turn alone must leave a median way of so much: a camera that turns on the spot shows no
    /// depth. Share of the image's width.
    double min_parallax = 0.004;
  };

  TwoViewStart(const Config& config, const geo::CameraIntrinsics& camera);

  /// Begins anew with this image, CV_8UC1.
  void Begin(const cv::Mat& grey);
  bool HasBegun() const { return !first_.empty(); }
  /// The last image is the first.
  bool HasJustBegun() const { return just_begun_; }

  /// Follows the corners into the next image. Once they went far enough: the motion
  /// new_from_first, its translation of length 1 (m); none before. When too few corners are left
  /// it begins anew with this image.
  std::optional<Eigen::Isometry3d> Follow(const cv::Mat& grey);

  /// The image it began with.
  const cv::Mat& first() const { return first_; }

 private:
  void KeepFollowed(const std::vector<cv::Point2f>& now, const std::vector<std::uint8_t>& found);
  double MedianWayPx() const;
  double MedianParallaxPx() const;
  std::optional<Eigen::Isometry3d> Motion() const;
  void Refine(Eigen::Isometry3d& new_from_first) const;
  Eigen::VectorXd SampsonErrors(const Eigen::Isometry3d& new_from_first) const;

  Config config_;
  geo::CameraIntrinsics camera_;
  cv::Mat first_, last_;
  bool just_begun_ = false;
  std::vector<cv::Point2f> begin_, end_;  // The same corners in the first and the last image.
};

}  // namespace livemap::odometry
