#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <string>

#include "edge_vo/edge_odometry.h"

namespace livemap {

/// One way to follow a camera through an RGB-D sequence.
class VoMethod {
 public:
  struct Step {
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
    bool lost = false;
    bool keyframe = false;
  };
  virtual ~VoMethod() = default;
  virtual Step Track(const RgbdFrame& frame) = 0;
};

/// "edge" is ours with `config`; "rgbd" and "rgbd-icp" are OpenCV's RgbdOdometry and
/// RgbdICPOdometry, frame to frame with their default settings. Throws Error naming what is
/// accepted.
std::unique_ptr<VoMethod> MakeVoMethod(const std::string& name, const EdgeOdometry::Config& config,
                                       const CameraIntrinsics& intrinsics);

}  // namespace livemap
