#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "geo/ground_projection.h"
#include "imaging/box.h"

namespace livemap::placement {

/// Distance along the camera's optical axis, pixel by pixel, registered to the rectified image.
struct DepthImage {
  cv::Mat depth;  ///< CV_32FC1 in metres, or CV_16UC1 in 1 / units_per_m; 0 and NaN are unknown.
  double units_per_m = 1000;
  std::shared_ptr<const void> owner;  ///< Of the pixels, where `depth` only looks at them.
};

/// How far a hazard's distance by depth can be trusted.
struct DepthNoise {
  /// Error that the whole image shares, standard deviation as a share of the depth.
  double sigma_share = 0.01;
  /// Depth outside is unknown, m.
  double min_m = 0.3;
  double max_m = 100.0;
};

/// The place of the thing in a box by the depth at the box's foot: the median over the middle half
/// of its lowest rows, along the ray through the bottom centre.
///
/// None where the depth is unknown: too few pixels have one, they disagree by more than a tenth
/// (half sky, half post), the point lies nowhere near the road, or the image is none of this
/// camera's. The covariance holds the scatter over the foot, what the box's lower edge (noise's
/// pixels) changes where the depth changes from row to row, the shared error, and pitch.
std::optional<geo::GroundPoint> ContactByDepth(const DepthImage& image, const imaging::Box& box,
                                               const geo::CameraIntrinsics& intrinsics,
                                               const Eigen::Isometry3d& base_from_optical,
                                               const geo::GroundProjectionNoise& noise,
                                               const DepthNoise& depth_noise);

}  // namespace livemap::placement
