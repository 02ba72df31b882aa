#pragma once

namespace livemap::geo {

/// Rectified pinhole camera, pixels: u = fx x/z + cx, v = fy y/z + cy in the optical frame (x
/// right, y down, z forward); (0, 0) is the centre of the first pixel, as in
/// sensor_msgs/CameraInfo.
struct CameraIntrinsics {
  double fx = 0;
  double fy = 0;
  double cx = 0;
  double cy = 0;
  int width = 0;
  int height = 0;
};

}  // namespace livemap::geo
