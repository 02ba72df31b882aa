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
/// in a RANSAC with a fixed seed), refined to the least Sampson error. A start by a short baseline
/// is provisional: the corners are followed further, the images after it are checked against it,
/// and a later image takes the second one's place. Equations (13) and (14) of
/// docs/explanation/monocular-odometry.md. The same images give the same start. Not thread-safe.
///
/// Typical usage:
///   start.Begin(first);
///   while (!motion) motion = start.Follow(next);
///   ...                              // Depths by the two images, and the path from them on.
///   while (start.IsProvisional()) {
///     if (start.Check(next, next_from_first) == TwoViewStart::Verdict::kRemake) {
///       motion = start.Remake();     // A longer baseline: the depths and the path anew.
///     }
///   }
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
    /// A start is provisional until the relative standard deviation of a depth of median parallax
    /// is at most this,
    double enough_depth_sigma = 0.1;
    /// where a corner's place, and that of an edge along its epipolar line, errs by so much,
    /// standard deviation, px.
    double pixel_sigma = 0.3;
  };

  /// What the images after a start say of it.
  enum class Verdict {
    kOpen,    ///< Nothing yet: it stays provisional.
    kHolds,   ///< It is provisional no more.
    kRemake,  ///< It is contradicted, or a much longer baseline has come: Remake().
    kFails,   ///< It is contradicted, and too few corners are left to make it anew.
  };

  TwoViewStart(const Config& config, const geo::CameraIntrinsics& camera);

  /// Begins anew with this image, CV_8UC1.
  void Begin(const cv::Mat& grey);
  bool HasBegun() const { return !first_.empty(); }
  /// The last image is the first.
  bool HasJustBegun() const { return just_begun_; }

  /// Follows the corners into the next image. Once they went far enough: the motion
  /// new_from_first, its translation of length 1; none before. When too few corners are left
  /// it begins anew with this image.
  std::optional<Eigen::Isometry3d> Follow(const cv::Mat& grey);

  /// A motion was found, and it has neither been verified nor given up.
  bool IsProvisional() const { return provisional_; }

  /// Follows the corners of a provisional start into the next image, and compares their places with
  /// those that the start's depths and the motion new_from_first lead to, whose unit is the length
  /// of the start's own translation.
  Verdict Check(const cv::Mat& grey, const Eigen::Isometry3d& new_from_first);

  /// After Verdict::kRemake: the motion from the first image to that of the last Check(), its
  /// translation of length 1, as from Follow(); that image is the start's second one from now on.
  /// None when the corners do not agree on a motion: the start stays as it was.
  std::optional<Eigen::Isometry3d> Remake();

  /// Relative standard deviation of a depth of median parallax by the start's two images.
  double DepthSigma() const;

  /// The image it began with.
  const cv::Mat& first() const { return first_; }

 private:
  void FollowCorners(const cv::Mat& grey);
  void KeepFollowed(const std::vector<cv::Point2f>& now, const std::vector<std::uint8_t>& found);
  double MedianWayPx() const;
  double MedianParallaxPx() const;
  double MedianMiss(const Eigen::Isometry3d& new_from_first) const;
  std::optional<Eigen::Isometry3d> Motion() const;
  void TakePair(const Eigen::Isometry3d& second_from_first);

  Config config_;
  geo::CameraIntrinsics camera_;
  cv::Mat first_, last_;
  bool just_begun_ = false;
  // The same corners in the first image, in the second one of a provisional start, in the last.
  std::vector<cv::Point2f> begin_, second_, end_;
  bool provisional_ = false;
  Eigen::Isometry3d second_from_first_ = Eigen::Isometry3d::Identity();
  double parallax_px_ = 0;  // Of the second image.
  int agreeing_ = 0;        // Images after the second.
  int contradicting_ = 0;   // Of those, less one for each that agrees since.
};

}  // namespace livemap::odometry
