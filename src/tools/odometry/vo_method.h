#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "odometry/edge/edge_odometry.h"

namespace livemap::tools {

/// One way to follow a camera through a sequence.
class VoMethod {
 public:
  struct Step {
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
    bool lost = false;
    bool keyframe = false;
    bool initialising = false;  ///< It has not started yet: there is no pose.
    /// With the first pose, where an earlier frame turns out to stand at the origin: its stamp.
    std::optional<std::int64_t> origin_stamp_ns{};
  };
  virtual ~VoMethod() = default;
  virtual Step Track(const odometry::RgbdFrame& frame) = 0;
};

/// "edge" is ours with `config`; "rgbd" and "rgbd-icp" are OpenCV's RgbdOdometry and
/// RgbdICPOdometry, frame to frame with their default settings. Throws Error naming what is
/// accepted.
std::unique_ptr<VoMethod> MakeVoMethod(const std::string& name,
                                       const odometry::EdgeOdometry::Config& config,
                                       const geo::CameraIntrinsics& intrinsics);

}  // namespace livemap::tools
