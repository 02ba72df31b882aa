#include "change/registration/registration.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "change/registration/depth_image.h"
#include "change/registration/robust_fit.h"

namespace livemap::change {
namespace {

constexpr double kReferenceWidth = 640;

/// Local magnifications and turn of a homography at a pixel.
struct LocalShape {
  bool in_front = false;
  double determinant = 0;
  double greatest = 0;
  double least = 0;
  double turn_rad = 0;
};

LocalShape WarpShapeAt(const cv::Matx33d& h, double x, double y) {
  LocalShape shape;
  const double w = h(2, 0) * x + h(2, 1) * y + h(2, 2);
  shape.in_front = w > 1e-6;
  if (!shape.in_front) return shape;
  const double u = (h(0, 0) * x + h(0, 1) * y + h(0, 2)) / w;
  const double v = (h(1, 0) * x + h(1, 1) * y + h(1, 2)) / w;
  const double a = (h(0, 0) - u * h(2, 0)) / w;
  const double b = (h(0, 1) - u * h(2, 1)) / w;
  const double c = (h(1, 0) - v * h(2, 0)) / w;
  const double d = (h(1, 1) - v * h(2, 1)) / w;
  shape.determinant = a * d - b * c;
  // Singular values of a 2x2 matrix in closed form.
  const double sum = std::hypot(a + d, c - b);
  const double difference = std::hypot(a - d, c + b);
  shape.greatest = (sum + difference) / 2;
  shape.least = std::abs(sum - difference) / 2;
  shape.turn_rad = std::atan2(c - b, a + d);
  return shape;
}

/// What is wrong with a homography for two drives down one road; empty when nothing is.
std::string WhyDegenerate(const cv::Matx33d& h, cv::Size size, const RegistrationConfig& options) {
  const double right = size.width - 1;
  const double low = size.height - 1;
  for (const auto& [x, y] :
       {std::pair(0.0, 0.0), {right, 0.0}, {0.0, low}, {right, low}, {right / 2, low / 2}}) {
    const LocalShape shape = WarpShapeAt(h, x, y);
    if (!shape.in_front || shape.determinant <= 0) return "the warp mirrors a part of the picture";
    if (shape.greatest > options.max_scale || shape.least * options.max_scale < 1) {
      return "the warp scales by " + RegistrationFigure(shape.least) + " to " +
             RegistrationFigure(shape.greatest) + ", accepted is up to " +
             RegistrationFigure(options.max_scale) + " and its inverse";
    }
    if (shape.greatest > options.max_shear * shape.least) {
      return "the warp shears by " + RegistrationFigure(shape.greatest / shape.least) +
             ", accepted is up to " + RegistrationFigure(options.max_shear);
    }
    const double turn_deg = std::abs(shape.turn_rad) * 180 / CV_PI;
    if (turn_deg > options.max_turn_deg) {
      return "the warp turns the picture by " + RegistrationFigure(turn_deg) +
             " degrees, accepted are up to " + RegistrationFigure(options.max_turn_deg);
    }
  }
  return "";
}

/// Matched points of both pictures, in one order.
struct MatchedPoints {
  std::vector<cv::Point2d> before;
  std::vector<cv::Point2d> after;
};

/// The checks that both registrations begin with.
MatchedPoints MatchForRegistration(const FeaturedView& before, const FeaturedView& after,
                                   const RegistrationConfig& options, Registration& registration) {
  MatchedPoints points;
  CheckRegistrationSizes(before.size, after.size, registration);
  if (!registration.accepted()) return points;
  const std::size_t fewer = std::min(before.features.points.size(), after.features.points.size());
  if (fewer < static_cast<std::size_t>(options.min_features)) {
    RefuseRegistration(RegistrationRefusal::kTexture,
                       "a picture has " + std::to_string(fewer) + " features, accepted are " +
                           std::to_string(options.min_features) + " and more",
                       registration);
    return points;
  }
  for (const auto& [a, b] : MatchFeatures(before.features, after.features, options.ratio)) {
    points.before.emplace_back(before.features.points[static_cast<std::size_t>(a)]);
    points.after.emplace_back(after.features.points[static_cast<std::size_t>(b)]);
  }
  registration.matches = points.before.size();
  if (points.before.size() < static_cast<std::size_t>(options.min_matches)) {
    RefuseRegistration(RegistrationRefusal::kMatches,
                       std::to_string(points.before.size()) + " features match, accepted are " +
                           std::to_string(options.min_matches) + " and more",
                       registration);
  }
  return points;
}

/// Are there enough inliers, do they lie apart, and do they fit?
void CheckInliers(const std::vector<cv::Point2d>& after, const RobustFit& fit, cv::Size size,
                  const RegistrationConfig& options, Registration& registration) {
  registration.inliers = fit.inliers.size();
  registration.error_px = fit.error_px;
  const auto inliers = static_cast<double>(fit.inliers.size());
  if (inliers < options.min_inliers ||
      inliers < options.min_inlier_share * static_cast<double>(registration.matches)) {
    RefuseRegistration(RegistrationRefusal::kInliers,
                       std::to_string(fit.inliers.size()) + " of " +
                           std::to_string(registration.matches) + " matches agree, accepted are " +
                           std::to_string(options.min_inliers) + " and more, and a share of " +
                           RegistrationFigure(options.min_inlier_share),
                       registration);
    return;
  }
  std::vector<cv::Point2f> agreeing;
  for (const std::size_t i : fit.inliers) agreeing.emplace_back(after[i]);
  std::vector<cv::Point2f> hull;
  cv::convexHull(agreeing, hull);
  const double spread = cv::contourArea(hull) / size.area();
  if (spread < options.min_spread) {
    RefuseRegistration(RegistrationRefusal::kSpread,
                       "the matches that agree cover a share of " + RegistrationFigure(spread) +
                           " of the picture, accepted is " +
                           RegistrationFigure(options.min_spread) + " and more",
                       registration);
    return;
  }
  const double max_error_px = options.max_error_px * size.width / kReferenceWidth;
  if (fit.error_px > max_error_px) {
    RefuseRegistration(RegistrationRefusal::kReprojection,
                       "the matches that agree are off by " + RegistrationFigure(fit.error_px) +
                           " px, accepted is up to " + RegistrationFigure(max_error_px),
                       registration);
  }
}

/// Depth at a feature; none where it jumps: nobody knows which side the feature belongs to.
double DepthAt(const cv::Mat& depth, const cv::Point2d& point) {
  const int x = static_cast<int>(std::lround(point.x));
  const int y = static_cast<int>(std::lround(point.y));
  if (x < 1 || y < 1 || x >= depth.cols - 1 || y >= depth.rows - 1) return 0;
  const double z = static_cast<double>(depth.at<float>(y, x));
  if (!(z > 0) || !std::isfinite(z)) return 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const double other = static_cast<double>(depth.at<float>(y + dy, x + dx));
      if (!(std::abs(other - z) <= 0.1 * z)) return 0;
    }
  }
  return z;
}

}  // namespace

std::string RegistrationFigure(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g", value);
  return text;
}

void RefuseRegistration(RegistrationRefusal refusal, const std::string& why,
                        Registration& registration) {
  registration.refusal = refusal;
  registration.why = why;
}

void CheckRegistrationSizes(cv::Size before, cv::Size after, Registration& registration) {
  if (before == after) return;
  RefuseRegistration(RegistrationRefusal::kSize,
                     "the earlier picture is " + std::to_string(before.width) + "x" +
                         std::to_string(before.height) + ", the later one " +
                         std::to_string(after.width) + "x" + std::to_string(after.height),
                     registration);
}

const char* RegistrationRefusalName(RegistrationRefusal refusal) {
  switch (refusal) {
    case RegistrationRefusal::kNone:
      return "none";
    case RegistrationRefusal::kSize:
      return "size";
    case RegistrationRefusal::kTexture:
      return "texture";
    case RegistrationRefusal::kMatches:
      return "matches";
    case RegistrationRefusal::kInliers:
      return "inliers";
    case RegistrationRefusal::kSpread:
      return "spread";
    case RegistrationRefusal::kReprojection:
      return "reprojection";
    case RegistrationRefusal::kDegenerate:
      return "degenerate";
    case RegistrationRefusal::kOverlap:
      return "overlap";
    case RegistrationRefusal::kEdges:
      return "edges";
  }
  return "unknown";
}

Registration RegisterByHomography(const FeaturedView& before, const FeaturedView& after,
                                  const RegistrationConfig& options, std::uint64_t seed) {
  Registration registration;
  const MatchedPoints points = MatchForRegistration(before, after, options, registration);
  if (!registration.accepted()) return registration;
  const double inlier_px = options.inlier_px * after.size.width / kReferenceWidth;
  const HomographyFit fit =
      FitHomography(points.before, points.after, inlier_px, options.max_tries, seed);
  CheckInliers(points.after, fit.fit, after.size, options, registration);
  if (!registration.accepted()) return registration;
  registration.after_from_before = fit.after_from_before;
  const std::string degenerate = WhyDegenerate(fit.after_from_before, after.size, options);
  if (!degenerate.empty()) {
    RefuseRegistration(RegistrationRefusal::kDegenerate, degenerate, registration);
    return registration;
  }
  const cv::Mat full(before.size, CV_8UC1, cv::Scalar(255));
  CheckOverlap(WarpByHomography(full, fit.after_from_before), options, registration);
  return registration;
}

Registration RegisterByDepth(const FeaturedView& before, const geo::CameraIntrinsics& before_camera,
                             const FeaturedView& after, const geo::CameraIntrinsics& after_camera,
                             const cv::Mat& after_depth, const RegistrationConfig& options,
                             std::uint64_t seed) {
  CheckDepthImage(after_depth, after.size);
  Registration registration;
  const MatchedPoints points = MatchForRegistration(before, after, options, registration);
  if (!registration.accepted()) return registration;
  std::vector<cv::Point3d> places;
  std::vector<cv::Point2d> seen;
  std::vector<cv::Point2d> at;
  for (std::size_t i = 0; i < points.after.size(); ++i) {
    const cv::Point2d& pixel = points.after[i];
    const double z = DepthAt(after_depth, pixel);
    if (z <= 0) continue;
    places.emplace_back((pixel.x - after_camera.cx) / after_camera.fx * z,
                        (pixel.y - after_camera.cy) / after_camera.fy * z, z);
    seen.push_back(points.before[i]);
    at.push_back(pixel);
  }
  registration.matches = places.size();
  if (places.size() < static_cast<std::size_t>(options.min_matches)) {
    RefuseRegistration(RegistrationRefusal::kMatches,
                       std::to_string(places.size()) + " features with depth match, accepted are " +
                           std::to_string(options.min_matches) + " and more",
                       registration);
    return registration;
  }
  const double inlier_px = options.inlier_px * after.size.width / kReferenceWidth;
  const PoseFit fit = FitPose(places, seen, before_camera, inlier_px, options.max_tries, seed);
  CheckInliers(at, fit.fit, after.size, options, registration);
  if (!registration.accepted()) return registration;
  registration.before_from_after = fit.camera_from_world;
  const double baseline_m = fit.camera_from_world.translation().norm();
  const double rotation_deg =
      Eigen::AngleAxisd(fit.camera_from_world.linear()).angle() * 180 / CV_PI;
  if (baseline_m > options.max_baseline_m || rotation_deg > options.max_rotation_deg) {
    RefuseRegistration(RegistrationRefusal::kDegenerate,
                       "the cameras are " + RegistrationFigure(baseline_m) + " m and " +
                           RegistrationFigure(rotation_deg) +
                           " degrees apart, accepted are up to " +
                           RegistrationFigure(options.max_baseline_m) + " and " +
                           RegistrationFigure(options.max_rotation_deg),
                       registration);
  }
  return registration;
}

void CheckOverlap(const WarpedPicture& warped, const RegistrationConfig& options,
                  Registration& registration) {
  if (!registration.accepted()) return;
  registration.overlap = warped.ValidShare();
  if (registration.overlap >= options.min_overlap) return;
  RefuseRegistration(
      RegistrationRefusal::kOverlap,
      "the earlier picture covers a share of " + RegistrationFigure(registration.overlap) +
          " of the later one, accepted is " + RegistrationFigure(options.min_overlap) + " and more",
      registration);
}

}  // namespace livemap::change
