#include "followed_frames.h"

#include <Eigen/LU>
#include <algorithm>

#include "odometry/se3.h"
#include "thread_time.h"

namespace livemap::bench {
namespace {

double SquaredOverCovariance(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance) {
  return error.dot(covariance.inverse() * error) / 3;
}

nlohmann::ordered_json MeanOrNull(const std::vector<double>& values) {
  if (values.empty()) return nullptr;
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

}  // namespace

const odometry::VoResult& FollowedFrames::Track(const odometry::RgbdFrame& frame,
                                                const std::optional<Eigen::Isometry3d>& truth) {
  const double start_ms = ThreadTimeMs();
  result_ = odometry_.Track(frame);
  run_.milliseconds.push_back(ThreadTimeMs() - start_ms);
  run_.lost += result_.state == odometry::VoState::kLost ? 1U : 0U;
  run_.keyframes += result_.new_keyframe ? 1U : 0U;
  last_step_error_m_ = 0;
  if (truth && last_truth_) {
    const datasets::StampedPose& last = run_.trajectory.back();
    AddStep(last.world_from_camera.inverse() * result_.world_from_camera,
            last_truth_->inverse() * *truth,
            1e-9 * static_cast<double>(frame.stamp_ns - last.stamp_ns));
  }
  run_.trajectory.push_back({frame.stamp_ns, result_.world_from_camera});
  last_truth_ = truth;
  return result_;
}

void FollowedFrames::AddStep(const Eigen::Isometry3d& stepped, const Eigen::Isometry3d& truth,
                             double seconds) {
  const odometry::Vector6d error = odometry::Se3Log(stepped.inverse() * truth);
  last_step_error_m_ = error.head<3>().norm();
  worst_step_m_ = std::max(worst_step_m_, last_step_error_m_);
  if (!result_.twist) return;
  const odometry::Matrix6d stated = seconds * seconds * result_.twist_covariance;
  nees_translation_.push_back(SquaredOverCovariance(error.head<3>(), stated.topLeftCorner<3, 3>()));
  nees_rotation_.push_back(
      SquaredOverCovariance(error.tail<3>(), stated.bottomRightCorner<3, 3>()));
}

nlohmann::ordered_json FollowedFrames::Figures(
    const std::vector<datasets::StampedPose>& truth) const {
  nlohmann::ordered_json json;
  json["tracked_frames"] = run_.trajectory.size();
  json.update(FiguresOf(truth, run_));
  json["worst_step_m"] = worst_step_m_;
  json["nees_translation"] = MeanOrNull(nees_translation_);
  json["nees_rotation"] = MeanOrNull(nees_rotation_);
  return json;
}

}  // namespace livemap::bench
