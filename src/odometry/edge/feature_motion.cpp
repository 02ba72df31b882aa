#include "odometry/edge/feature_motion.h"

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>

namespace livemap::odometry {
namespace {

constexpr int kMostFeatures = 800;
constexpr float kFeatureRatio = 0.85F;  // Of the best match's distance to the second's (Lowe).
constexpr int kFeatureTries = 200;
constexpr float kFeaturePx = 4;
constexpr int kFeatureMinAgreeing = 10;

}  // namespace

void FindFeatures(const cv::Mat& grey, PictureFeatures& features) {
  features.Clear();
  features.found = true;
  std::vector<cv::KeyPoint> corners;
  cv::ORB::create(kMostFeatures, 1.3F, 5, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31, 12)
      ->detectAndCompute(grey, cv::noArray(), corners, features.descriptors);
  cv::KeyPoint::convert(corners, features.pixels);
}

std::optional<Eigen::Isometry3d> NewFromReferenceByFeatures(const PictureFeatures& reference,
                                                            const cv::Mat& reference_depth_m,
                                                            const PictureFeatures& picture,
                                                            const geo::CameraIntrinsics& camera) {
  if (reference.descriptors.rows < kFeatureMinAgreeing || picture.descriptors.rows < 2) return {};
  std::vector<std::vector<cv::DMatch>> matches;
  cv::BFMatcher(cv::NORM_HAMMING).knnMatch(reference.descriptors, picture.descriptors, matches, 2);
  std::vector<cv::Point3f> points;
  std::vector<cv::Point2f> pixels;
  for (const auto& match : matches) {
    if (match.size() < 2 || match[0].distance > kFeatureRatio * match[1].distance) continue;
    const cv::Point2f& from = reference.pixels[static_cast<std::size_t>(match[0].queryIdx)];
    const float depth = reference_depth_m.at<float>(static_cast<int>(std::lround(from.y)),
                                                    static_cast<int>(std::lround(from.x)));
    if (depth <= 0) continue;
    points.emplace_back(
        (from.x - static_cast<float>(camera.cx)) / static_cast<float>(camera.fx) * depth,
        (from.y - static_cast<float>(camera.cy)) / static_cast<float>(camera.fy) * depth, depth);
    pixels.push_back(picture.pixels[static_cast<std::size_t>(match[0].trainIdx)]);
  }
  if (points.size() < static_cast<std::size_t>(kFeatureMinAgreeing)) return {};
  const cv::Matx33d matrix(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  cv::Vec3d turn, move;
  std::vector<int> agreeing;
  // Its random numbers start from the same seed in every call.
  if (!cv::solvePnPRansac(points, pixels, matrix, cv::noArray(), turn, move, false, kFeatureTries,
                          kFeaturePx, 0.999, agreeing, cv::SOLVEPNP_P3P) ||
      agreeing.size() < static_cast<std::size_t>(kFeatureMinAgreeing)) {
    return {};
  }
  const Eigen::Vector3d axis(turn[0], turn[1], turn[2]);
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.translation() = Eigen::Vector3d(move[0], move[1], move[2]);
  if (axis.norm() > 0)
    motion.linear() = Eigen::AngleAxisd(axis.norm(), axis.normalized()).toRotationMatrix();
  if (!motion.matrix().allFinite()) return {};
  return motion;
}

}  // namespace livemap::odometry
