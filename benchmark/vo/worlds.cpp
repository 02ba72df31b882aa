#include <Eigen/LU>
#include <optional>

#include "evaluation/quantile.h"
#include "measurements.h"
#include "odometry/se3.h"
#include "thread_time.h"

namespace livemap::bench {
namespace {

/// Normalised squared errors of steps, per degree of freedom: 1 where what is stated is true.
struct StepErrors {
  std::vector<double> translation, rotation;
  double worst_m = 0;
};

double SquaredOverCovariance(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance) {
  return error.dot(covariance.inverse() * error) / 3;
}

/// The step between two poses against the true one, and what was stated of it.
void AddStep(const Eigen::Isometry3d& stepped, const Eigen::Isometry3d& truth, double seconds,
             const odometry::VoResult& result, StepErrors& errors) {
  const odometry::Vector6d error = odometry::Se3Log(stepped.inverse() * truth);
  errors.worst_m = std::max(errors.worst_m, error.head<3>().norm());
  if (!result.twist) return;
  const odometry::Matrix6d stated = seconds * seconds * result.twist_covariance;
  errors.translation.push_back(
      SquaredOverCovariance(error.head<3>(), stated.topLeftCorner<3, 3>()));
  errors.rotation.push_back(
      SquaredOverCovariance(error.tail<3>(), stated.bottomRightCorner<3, 3>()));
}

nlohmann::ordered_json MeanOrNull(const std::vector<double>& values) {
  if (values.empty()) return nullptr;
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

}  // namespace

nlohmann::ordered_json MeasureWorld(const Recording& recording, std::size_t step) {
  odometry::EdgeOdometry odometry({}, recording.camera());
  MethodRun run;
  StepErrors errors;
  Eigen::Isometry3d last_pose = Eigen::Isometry3d::Identity();
  std::optional<Eigen::Isometry3d> last_truth;
  std::int64_t last_stamp_ns = 0;
  for (std::size_t i = 0; i < recording.size(); i += step) {
    const odometry::RgbdFrame frame = recording.Read(i);
    const double start_ms = ThreadTimeMs();
    const odometry::VoResult result = odometry.Track(frame);
    run.milliseconds.push_back(ThreadTimeMs() - start_ms);
    run.trajectory.push_back({frame.stamp_ns, result.world_from_camera});
    run.lost += result.state == odometry::VoState::kLost ? 1U : 0U;
    run.keyframes += result.new_keyframe ? 1U : 0U;
    const std::optional<Eigen::Isometry3d> truth = recording.TruthAt(i);
    if (truth && last_truth) {
      AddStep(last_pose.inverse() * result.world_from_camera, last_truth->inverse() * *truth,
              1e-9 * static_cast<double>(frame.stamp_ns - last_stamp_ns), result, errors);
    }
    last_pose = result.world_from_camera;
    last_truth = truth;
    last_stamp_ns = frame.stamp_ns;
  }
  nlohmann::ordered_json json = DescriptionOf(recording);
  json["step"] = step;
  json["tracked_frames"] = run.trajectory.size();
  json.update(FiguresOf(recording.truth(), run));
  json["worst_step_m"] = errors.worst_m;
  json["nees_translation"] = MeanOrNull(errors.translation);
  json["nees_rotation"] = MeanOrNull(errors.rotation);
  return json;
}

}  // namespace livemap::bench
