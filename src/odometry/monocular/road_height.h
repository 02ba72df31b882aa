#pragma once

#include <optional>
#include <vector>

#include "odometry/monocular/inverse_depth_map.h"

namespace livemap::odometry {

/// The camera's height over the road, in the unit of the depths: that of the plane, near the one
/// that a level car's wheels stand on, which most edges ahead lie on. `pitch_rad`: the camera's,
/// positive looks down. None when too few edges lie on one plane.
std::optional<double> RoadHeight(const std::vector<EdgeDepth>& edges,
                                 const geo::CameraIntrinsics& camera, double pitch_rad);

}  // namespace livemap::odometry
