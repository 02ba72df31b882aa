#pragma once

#include <Eigen/Core>

#include "geo/ground_projection.h"
#include "placement/sighting.h"

namespace livemap::placement {

/// A box with corners in order, a confidence within [0, 1] and a name of a class; all finite.
bool IsWellFormed(const Sighting& sighting);

/// Bottom centre of a box as a camera model counts pixels: its edges count from the first pixel's
/// outer corner, the model from that pixel's centre.
Eigen::Vector2d ContactPixel(const imaging::Box& box);

/// The image's left or right side cuts the box: what it shows may end above the foot, which would
/// then be placed too far away.
bool IsCutBySide(const imaging::Box& box, double image_width);

/// Standard deviation along the worst axis.
double LargestSigmaM(const Eigen::Matrix2d& covariance_m2);

/// A foot within `max_range_m` of base_link, known to `max_sigma_m` when the error of the heading,
/// which swings it, counts too. Not if anything is NaN.
bool IsNearEnough(const geo::GroundPoint& foot, double heading_variance_rad2, double max_range_m,
                  double max_sigma_m);

}  // namespace livemap::placement
