#include "change/registration/robust_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "common/median.h"

namespace livemap::change {
namespace {

constexpr std::size_t kSample = 4;
constexpr double kConfidence = 0.999;
constexpr int kRefinements = 10;
constexpr double kMinScalePx = 0.05;
constexpr double kFar = 1e9;  // Squared pixels: agrees with nothing.

using Sample = std::array<std::size_t, kSample>;

/// Four different indices below `count`. std::uniform_int_distribution may differ between standard
/// libraries; a plain remainder's bias is nothing here.
Sample DrawFitSample(std::size_t count, std::mt19937_64& random) {
  Sample sample{};
  for (std::size_t i = 0; i < kSample; ++i) {
    do {
      sample[i] = random() % count;
    } while (std::find(sample.begin(), sample.begin() + i, sample[i]) != sample.begin() + i);
  }
  return sample;
}

/// Tries that find one sample of inliers only, with kConfidence.
int FitTriesWanted(std::size_t inliers, std::size_t count, int most) {
  const double share = static_cast<double>(inliers) / static_cast<double>(count);
  const double all_good = std::pow(share, kSample);
  if (all_good > 1 - 1e-9) return 1;
  const double tries = std::log(1 - kConfidence) / std::log(1 - all_good);
  return tries < most ? static_cast<int>(std::ceil(tries)) : most;
}

/// `errors`: squared pixels.
RobustFit RobustFitOf(const std::vector<double>& errors, double inlier_px) {
  RobustFit fit;
  const double most = inlier_px * inlier_px;
  double sum = 0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (errors[i] > most) continue;
    fit.inliers.push_back(i);
    sum += errors[i];
  }
  const auto inliers = static_cast<double>(fit.inliers.size());
  if (inliers > 0) fit.error_px = std::sqrt(sum / inliers);
  fit.cost = sum + most * (static_cast<double>(errors.size()) - inliers);
  return fit;
}

std::vector<double> HomographyFitErrors(const cv::Matx33d& h,
                                        const std::vector<cv::Point2d>& before,
                                        const std::vector<cv::Point2d>& after) {
  std::vector<double> errors(before.size(), kFar);
  for (std::size_t i = 0; i < before.size(); ++i) {
    const cv::Vec3d place = h * cv::Vec3d(before[i].x, before[i].y, 1);
    if (place[2] < 1e-9) continue;
    const double x = place[0] / place[2] - after[i].x;
    const double y = place[1] / place[2] - after[i].y;
    errors[i] = x * x + y * y;
  }
  return errors;
}

/// A mirrored triangle cannot come from a plane seen twice from the front.
bool FitKeepsOrientation(const std::array<cv::Point2f, kSample>& from,
                         const std::array<cv::Point2f, kSample>& to) {
  for (std::size_t skipped = 0; skipped < kSample; ++skipped) {
    std::array<std::size_t, 3> corner{};
    for (std::size_t i = 0, j = 0; i < kSample; ++i) {
      if (i != skipped) corner[j++] = i;
    }
    const auto area = [&](const std::array<cv::Point2f, kSample>& p) {
      const cv::Point2f a = p[corner[1]] - p[corner[0]];
      const cv::Point2f b = p[corner[2]] - p[corner[0]];
      return a.cross(b);
    };
    const double first = area(from);
    const double second = area(to);
    // Nearly on one line: no plane is defined by them.
    if (first * second <= 0 || std::abs(first) < 20 || std::abs(second) < 20) return false;
  }
  return true;
}

cv::Matx33d HomographyFitOf(const Sample& sample, const std::vector<cv::Point2d>& before,
                            const std::vector<cv::Point2d>& after) {
  std::array<cv::Point2f, kSample> from;
  std::array<cv::Point2f, kSample> to;
  for (std::size_t i = 0; i < kSample; ++i) {
    from[i] = before[sample[i]];
    to[i] = after[sample[i]];
  }
  if (!FitKeepsOrientation(from, to)) return cv::Matx33d::zeros();
  return cv::getPerspectiveTransform(from.data(), to.data());
}

/// One step of Gauss and Newton on the eight numbers of a homography, each match weighted by
/// Cauchy's 1 / (1 + error^2 / scale^2): the inliers' own outliers must not pull it.
cv::Matx33d StepHomographyFit(const cv::Matx33d& h, const std::vector<cv::Point2d>& before,
                              const std::vector<cv::Point2d>& after,
                              const std::vector<std::size_t>& inliers, double scale_px) {
  Eigen::Matrix<double, 8, 8> normal = Eigen::Matrix<double, 8, 8>::Zero();
  Eigen::Matrix<double, 8, 1> right = Eigen::Matrix<double, 8, 1>::Zero();
  for (const std::size_t i : inliers) {
    const cv::Vec3d place = h * cv::Vec3d(before[i].x, before[i].y, 1);
    const double u = place[0] / place[2];
    const double v = place[1] / place[2];
    const Eigen::Vector2d residual(after[i].x - u, after[i].y - v);
    const double x = before[i].x / place[2];
    const double y = before[i].y / place[2];
    const double one = 1 / place[2];
    Eigen::Matrix<double, 2, 8> jacobian;
    jacobian << x, y, one, 0, 0, 0, -u * x, -u * y, 0, 0, 0, x, y, one, -v * x, -v * y;
    const double weight = 1 / (1 + residual.squaredNorm() / (scale_px * scale_px));
    normal += weight * jacobian.transpose() * jacobian;
    right += weight * jacobian.transpose() * residual;
  }
  // A column is as large as its unit makes it; without that the solution loses its digits.
  const Eigen::Matrix<double, 8, 1> unit = normal.diagonal().cwiseSqrt().cwiseMax(1e-12);
  normal = unit.cwiseInverse().asDiagonal() * normal * unit.cwiseInverse().asDiagonal();
  const Eigen::Matrix<double, 8, 1> step =
      normal.ldlt().solve(right.cwiseQuotient(unit)).cwiseQuotient(unit);
  if (!step.allFinite()) return h;
  cv::Matx33d stepped = h;
  for (int i = 0; i < 8; ++i) stepped.val[i] += step[i];
  return stepped;
}

/// The inliers' own scale: what half of them keep to, as a standard deviation.
double RobustScaleOf(const std::vector<double>& errors, const std::vector<std::size_t>& inliers) {
  std::vector<double> kept;
  kept.reserve(inliers.size());
  for (const std::size_t i : inliers) kept.push_back(errors[i]);
  return std::max(kMedianToSigma * std::sqrt(TakeMedian(kept)), kMinScalePx);
}

/// Fits the inliers and takes in what then agrees, as long as none is lost.
void RefineHomographyFit(const std::vector<cv::Point2d>& before,
                         const std::vector<cv::Point2d>& after, double inlier_px,
                         HomographyFit& best) {
  for (int i = 0; i < kRefinements && best.fit.inliers.size() > kSample; ++i) {
    const cv::Matx33d h = best.after_from_before * (1 / best.after_from_before(2, 2));
    const double scale_px = RobustScaleOf(HomographyFitErrors(h, before, after), best.fit.inliers);
    const cv::Matx33d refined = StepHomographyFit(h, before, after, best.fit.inliers, scale_px);
    const RobustFit fit = RobustFitOf(HomographyFitErrors(refined, before, after), inlier_px);
    if (fit.inliers.size() < best.fit.inliers.size()) return;
    best = {fit, refined};
  }
}

cv::Matx33d CameraMatrixForFit(const geo::CameraIntrinsics& camera) {
  return {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
}

Eigen::Isometry3d FittedPoseOf(const cv::Vec3d& rotation, const cv::Vec3d& translation) {
  cv::Matx33d matrix;
  cv::Rodrigues(rotation, matrix);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) pose.linear()(row, column) = matrix(row, column);
    pose.translation()[row] = translation[row];
  }
  return pose;
}

std::vector<double> PoseFitErrors(const Eigen::Isometry3d& pose,
                                  const std::vector<cv::Point3d>& places,
                                  const std::vector<cv::Point2d>& seen,
                                  const geo::CameraIntrinsics& camera) {
  std::vector<double> errors(places.size(), kFar);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Eigen::Vector3d point = pose * Eigen::Vector3d(places[i].x, places[i].y, places[i].z);
    if (!(point.z() > 0.01)) continue;
    const double x = camera.fx * point.x() / point.z() + camera.cx - seen[i].x;
    const double y = camera.fy * point.y() / point.z() + camera.cy - seen[i].y;
    errors[i] = x * x + y * y;
  }
  return errors;
}

/// Rotation and translation as OpenCV has them.
struct CameraPose {
  cv::Vec3d rotation;
  cv::Vec3d translation;
  bool found = false;
};

CameraPose PoseFitOfSample(const Sample& sample, const std::vector<cv::Point3d>& places,
                           const std::vector<cv::Point2d>& seen, const cv::Matx33d& matrix) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (const std::size_t index : sample) {
    points.push_back(places[index]);
    pixels.push_back(seen[index]);
  }
  CameraPose pose;
  pose.found = cv::solvePnP(points, pixels, matrix, cv::noArray(), pose.rotation, pose.translation,
                            false, cv::SOLVEPNP_AP3P);
  return pose;
}

}  // namespace

HomographyFit FitHomography(const std::vector<cv::Point2d>& before,
                            const std::vector<cv::Point2d>& after, double inlier_px, int max_tries,
                            std::uint64_t seed) {
  HomographyFit best;
  if (before.size() < kSample) return best;
  std::mt19937_64 random(seed);
  int wanted = max_tries;
  for (int i = 0; i < wanted; ++i) {
    const cv::Matx33d h = HomographyFitOf(DrawFitSample(before.size(), random), before, after);
    if (h(2, 2) == 0) continue;
    const RobustFit fit = RobustFitOf(HomographyFitErrors(h, before, after), inlier_px);
    if (fit.inliers.size() < kSample || fit.cost >= best.fit.cost) continue;
    best = {fit, h};
    // A sample of four carries their noise; refined it also finds the inliers it missed.
    RefineHomographyFit(before, after, inlier_px, best);
    wanted = FitTriesWanted(best.fit.inliers.size(), before.size(), max_tries);
  }
  return best;
}

PoseFit FitPose(const std::vector<cv::Point3d>& places, const std::vector<cv::Point2d>& seen,
                const geo::CameraIntrinsics& camera, double inlier_px, int max_tries,
                std::uint64_t seed) {
  PoseFit best;
  if (places.size() < kSample) return best;
  const cv::Matx33d matrix = CameraMatrixForFit(camera);
  std::mt19937_64 random(seed);
  CameraPose pose;
  int wanted = max_tries;
  for (int i = 0; i < wanted; ++i) {
    const CameraPose tried =
        PoseFitOfSample(DrawFitSample(places.size(), random), places, seen, matrix);
    if (!tried.found) continue;
    const Eigen::Isometry3d transform = FittedPoseOf(tried.rotation, tried.translation);
    const RobustFit fit = RobustFitOf(PoseFitErrors(transform, places, seen, camera), inlier_px);
    if (fit.inliers.size() < kSample || fit.cost >= best.fit.cost) continue;
    best = {fit, transform};
    pose = tried;
    wanted = FitTriesWanted(fit.inliers.size(), places.size(), max_tries);
  }
  for (int i = 0; i < kRefinements && best.fit.inliers.size() > kSample; ++i) {
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> pixels;
    for (const std::size_t index : best.fit.inliers) {
      points.push_back(places[index]);
      pixels.push_back(seen[index]);
    }
    cv::solvePnPRefineLM(points, pixels, matrix, cv::noArray(), pose.rotation, pose.translation);
    const Eigen::Isometry3d transform = FittedPoseOf(pose.rotation, pose.translation);
    const RobustFit fit = RobustFitOf(PoseFitErrors(transform, places, seen, camera), inlier_px);
    if (fit.inliers.size() < best.fit.inliers.size()) break;
    best = {fit, transform};
  }
  return best;
}

}  // namespace livemap::change
