#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>

#include "odometry/edge/edge_extractor.h"
#include "odometry/edge/feature_motion.h"
#include "odometry/edge/image_pyramid.h"
#include "odometry/edge/picture_points.h"
#include "odometry/edge/point_selector.h"
#include "odometry/edge/surface_points.h"
#include "odometry/se3.h"

namespace livemap::odometry {

/// A frame with depth that later frames are aligned with. Its buffers are used again when a newer
/// keyframe takes its place.
struct Keyframe {
  std::int64_t stamp_ns = 0;
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< Of world_from_camera, see VoResult::covariance.
  ImagePyramid images;
  DepthPyramid depths;
  /// Standard deviations of the inverse depths, 1/m, where depths are estimates; else no levels.
  DepthPyramid inverse_depth_sigmas;
  std::array<EdgePoints, kMaxLevels> points;  ///< Under its own edges.
  /// The finest level whose points cover the picture, on which alignments end: a soft picture has
  /// edges on coarse levels only.
  int finest_level = 0;
  EdgePoints thumbnail_points;  ///< Every pixel of the thumbnail, for rotations.
  /// Of its measured surfaces; none where depths are estimates.
  SurfacePoints surfaces;
  /// Of its picture; none where depths are estimates.
  PicturePoints picture;
  PictureFeatures features;  ///< Found when they are first needed.

  const EdgePoints& finest_points() const { return points[static_cast<std::size_t>(finest_level)]; }
};

}  // namespace livemap::odometry
