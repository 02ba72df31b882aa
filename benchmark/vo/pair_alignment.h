#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "odometry/edge/edge_odometry.h"

namespace livemap::bench {

/// One way to find the motion between two frames from a guess.
class PairAlignment {
 public:
  virtual ~PairAlignment() = default;
  virtual std::string name() const = 0;
  /// The frames that the guesses to come are about.
  virtual void Take(const odometry::RgbdFrame& reference, const odometry::RgbdFrame& image) = 0;
  /// The motion found, image from reference; none when the method gives up.
  virtual std::optional<Eigen::Isometry3d> Align(const Eigen::Isometry3d& guess) = 0;
};

/// "edge": ours, coarse to fine from the guess alone, with the default parameters and without what
/// EdgeOdometry does when it is lost. "rgbd", "rgbd-icp": OpenCV's, default settings but for the
/// limits on the motion, which are lifted.
std::vector<std::unique_ptr<PairAlignment>> MakePairAlignments(const geo::CameraIntrinsics& camera);

}  // namespace livemap::bench
