#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>

#include "change/registration/edge_correlation.h"
#include "change/registration/image_features.h"
#include "change/registration/warp.h"
#include "geo/camera_intrinsics.h"

namespace livemap::change {

/// When two pictures count as showing one place. Pixels are those of a picture 640 wide; for other
/// widths they are scaled.
struct RegistrationConfig {
  double ratio = 0.8;              ///< Of the ratio test between features.
  double inlier_px = 6.0;          ///< A match agrees when it lies nearer than this to its place.
  int max_tries = 2000;            ///< Of RANSAC; fewer when the agreement is good.
  int min_features = 40;           ///< In each picture; fewer: no texture.
  int min_matches = 15;            ///< That pass the ratio test.
  int min_inliers = 10;            ///< Matches that agree.
  double min_inlier_share = 0.25;  ///< Of the matches.
  double min_spread = 0.1;         ///< Area of the agreeing matches' hull, share of the picture.
  double min_overlap = 0.5;        ///< Share of the later picture that the earlier one covers.
  double max_error_px = 4.0;       ///< Root mean square of the agreeing matches.
  double max_scale = 1.6;        ///< Local magnification, or its inverse, anywhere in the picture.
  double max_shear = 1.8;        ///< Ratio of the greatest to the least local magnification.
  double max_turn_deg = 15;      ///< In the picture: vehicles stand upright.
  double max_baseline_m = 10;    ///< Between the two cameras, when there is depth.
  double max_rotation_deg = 30;  ///< The same.
  EdgeSearch edges;              ///< What RegisterByEdges looks through.
  /// Of the edges' correlation, its lead over all other places, and the fine edges' agreement
  /// together. Right pairs have all three, wrong ones at most one of them.
  double min_edge_evidence = 0.82;
};

/// Why a pair was refused.
enum class RegistrationRefusal {
  kNone,
  kSize,          ///< The pictures differ in size.
  kTexture,       ///< Too few features in one of them.
  kMatches,       ///< Too few match.
  kInliers,       ///< Too few matches agree on one warp.
  kSpread,        ///< They agree in one corner only.
  kReprojection,  ///< They agree badly.
  kDegenerate,    ///< The warp mirrors, shears, turns or scales as no second drive does.
  kOverlap,       ///< The earlier picture covers too little of the later one.
  kEdges,         ///< Their edges fit nowhere clearly.
};

/// "none", "size", "texture", ...
const char* RegistrationRefusalName(RegistrationRefusal refusal);

/// How the two pictures fit. Without a refusal everything else is set.
struct Registration {
  RegistrationRefusal refusal = RegistrationRefusal::kNone;
  std::string why;  ///< One sentence with the figures; empty when not refused.
  std::size_t matches = 0;
  std::size_t inliers = 0;
  double error_px = 0;       ///< Root mean square of the inliers, real pixels.
  double overlap = 0;        ///< Share of the later picture.
  double edge_evidence = 0;  ///< The sum that min_edge_evidence limits.
  /// Pixel of the earlier picture to pixel of the later one; of RegisterByHomography and
  /// RegisterByEdges.
  cv::Matx33d after_from_before = cv::Matx33d::eye();
  /// Optical frames; of RegisterByDepth.
  Eigen::Isometry3d before_from_after = Eigen::Isometry3d::Identity();

  bool accepted() const { return refusal == RegistrationRefusal::kNone; }
};

/// A picture's size with its features.
struct FeaturedView {
  cv::Size size;
  ImageFeatures features;
};

/// Finds the homography by which the earlier picture fits the later one (thesis 4.3): matches,
/// RANSAC over four of them, least squares over those that agree. The same `seed` gives the same
/// result. `overlap` is computed from the warp of the picture's frame.
Registration RegisterByHomography(const FeaturedView& before, const FeaturedView& after,
                                  const RegistrationConfig& options, std::uint64_t seed);

/// Finds the pose of the earlier camera from matches whose place in the later picture has a depth:
/// RANSAC over a perspective-three-point solver, then Levenberg-Marquardt. `after_depth` is
/// CV_32FC1, metres along the optical axis, 0 or NaN: unknown; Error when it has not the size of
/// `after`. Both cameras are rectified. `overlap` stays to be filled from WarpByDepth's mask, see
/// CheckOverlap.
Registration RegisterByDepth(const FeaturedView& before, const geo::CameraIntrinsics& before_camera,
                             const FeaturedView& after, const geo::CameraIntrinsics& after_camera,
                             const cv::Mat& after_depth, const RegistrationConfig& options,
                             std::uint64_t seed);

/// A figure as sentences of a refusal have it.
std::string RegistrationFigure(double value);
/// Sets the refusal and its sentence.
void RefuseRegistration(RegistrationRefusal refusal, const std::string& why,
                        Registration& registration);
/// Refuses pictures of two sizes.
void CheckRegistrationSizes(cv::Size before, cv::Size after, Registration& registration);
/// Refuses an accepted registration whose warp covers too little.
void CheckOverlap(const WarpedPicture& warped, const RegistrationConfig& options,
                  Registration& registration);

}  // namespace livemap::change
