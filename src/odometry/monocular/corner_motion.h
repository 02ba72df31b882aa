#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "geo/camera_intrinsics.h"

namespace livemap::odometry {

/// The ray through a pixel in the optical frame, its z 1.
Eigen::Vector3d RayOfCorner(const cv::Point2f& pixel, const geo::CameraIntrinsics& camera);

/// Where the corners of one image lie in the next one, and which of them were found there: also
/// when followed back (OpenCV: Lucas-Kanade).
struct FollowedCorners {
  std::vector<cv::Point2f> now;
  std::vector<std::uint8_t> found;  ///< 1 or 0.
};
/// `corners` are not empty; both images are CV_8UC1 of one size.
FollowedCorners FollowCorners(const cv::Mat& before, const cv::Mat& now,
                              const std::vector<cv::Point2f>& corners);

/// The same corners in two images.
struct CornerPairs {
  const std::vector<cv::Point2f>&before, &now;
};

/// First-order geometric errors of all corners against the epipolar constraint of a motion, px
/// (Hartley and Zisserman 2004, equation 11.9).
Eigen::VectorXd SampsonErrors(const CornerPairs& corners, const geo::CameraIntrinsics& camera,
                              const Eigen::Isometry3d& now_from_before);

/// Brings a motion, whose translation is not 0, to the least Sampson error: Gauss-Newton with
/// Huber weights over the rotation and the translation's direction. Its length stays.
void RefineByCorners(const CornerPairs& corners, const geo::CameraIntrinsics& camera,
                     double inlier_px, Eigen::Isometry3d& now_from_before);

/// Compares a motion by edges and their depths with what corners say of it, which need no depths.
/// Depths are learnt by the motions and motions found by the depths: a turn that both agree on need
/// not be one, and grows from keyframe to keyframe.
class CornerCheck {
 public:
  struct Config {
    int corners = 200;
    /// Corners that must be found again, and their share that must agree.
    std::size_t min_corners = 60;
    double min_inliers = 0.7;
    double inlier_px = 1.0;
    /// The corners' turn differs at least by so much, rad,
    double least_turn_rad = 0.004;
    /// and leaves at most this share of the error that the given motion leaves.
    double most_error = 0.6;
  };

  CornerCheck(const Config& config, const geo::CameraIntrinsics& camera)
      : config_(config), camera_(camera) {}

  /// The motion by the corners, as long as the given one, where they contradict that; none where
  /// they do not, or are too few to say. Images are CV_8UC1 of the camera's size.
  std::optional<Eigen::Isometry3d> Contradicting(const cv::Mat& before, const cv::Mat& now,
                                                 const Eigen::Isometry3d& now_from_before) const;

 private:
  Config config_;
  geo::CameraIntrinsics camera_;
};

}  // namespace livemap::odometry
