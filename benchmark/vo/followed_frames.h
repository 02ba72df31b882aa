#pragma once

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "recording.h"

namespace livemap::bench {

/// The default odometry following frames one after the other, and what it is wrong by.
///
/// Typical usage:
///   FollowedFrames followed(camera);
///   for (...) followed.Track(frame, truth);
///   std::cout << followed.Figures(truths);
class FollowedFrames {
 public:
  explicit FollowedFrames(const geo::CameraIntrinsics& camera) : odometry_({}, camera) {}

  /// The next frame, with the true pose of its camera where there is one.
  const odometry::VoResult& Track(const odometry::RgbdFrame& frame,
                                  const std::optional<Eigen::Isometry3d>& truth);

  /// FiguresOf(), the largest error of a step (m), and the mean normalised squared errors of steps
  /// per degree of freedom: 1 where the stated covariance is true, null where no step had one.
  nlohmann::ordered_json Figures(const std::vector<datasets::StampedPose>& truth) const;

  double last_step_error_m() const { return last_step_error_m_; }
  double worst_step_m() const { return worst_step_m_; }
  std::size_t lost() const { return run_.lost; }
  std::size_t size() const { return run_.trajectory.size(); }

 private:
  void AddStep(const Eigen::Isometry3d& stepped, const Eigen::Isometry3d& truth, double seconds);

  odometry::EdgeOdometry odometry_;
  odometry::VoResult result_;
  MethodRun run_;
  std::vector<double> nees_translation_, nees_rotation_;
  double last_step_error_m_ = 0, worst_step_m_ = 0;
  std::optional<Eigen::Isometry3d> last_truth_;
};

}  // namespace livemap::bench
