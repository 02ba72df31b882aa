#include "recording.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "common/error.h"
#include "datasets/stamp_pairs.h"
#include "evaluation/quantile.h"
#include "evaluation/trajectory/trajectory_report.h"
#include "tools/odometry/sequence_pictures.h"

namespace livemap::bench {
namespace {

std::vector<std::optional<Eigen::Isometry3d>> PairWithTruth(const datasets::Sequence& sequence) {
  std::vector<std::int64_t> frames, poses;
  for (const datasets::SequenceFrame& frame : sequence.frames) frames.push_back(frame.stamp_ns);
  for (const datasets::StampedPose& pose : sequence.poses) poses.push_back(pose.stamp_ns);
  std::vector<std::optional<Eigen::Isometry3d>> truth(frames.size());
  for (const auto& [frame, pose] :
       datasets::PairNearestStamps(frames, poses, datasets::kMaxDepthDifferenceNs)) {
    truth[frame] = sequence.poses[pose].world_from_camera;
  }
  return truth;
}

}  // namespace

Recording::Recording(const std::string& directory, const std::string& camera_file,
                     std::size_t max_frames)
    : sequence_(datasets::ReadTumSequence(directory, camera_file)) {
  for (const datasets::SequenceFrame& frame : sequence_.frames) {
    if (frame.depth_path.empty()) throw Error("the sequence '" + directory + "' has no depth");
  }
  sequence_.frames.resize(std::min(sequence_.frames.size(), max_frames));
  camera_ = tools::IntrinsicsOf(sequence_);
  truth_at_ = PairWithTruth(sequence_);
}

cv::Mat Recording::ReadColour(std::size_t index) const {
  return tools::ReadColourPicture(sequence_.frames[index].image_path, camera_);
}

odometry::RgbdFrame Recording::ReadDepth(std::size_t index) const {
  const datasets::SequenceFrame& source = sequence_.frames[index];
  odometry::RgbdFrame frame;
  frame.stamp_ns = source.stamp_ns;
  frame.depth = tools::ReadDepthPicture(source.depth_path, camera_);
  frame.depth_units_per_m = sequence_.depth_scale;
  return frame;
}

odometry::RgbdFrame Recording::Read(std::size_t index) const {
  odometry::RgbdFrame frame = ReadDepth(index);
  cv::cvtColor(ReadColour(index), frame.grey, cv::COLOR_BGR2GRAY);
  return frame;
}

std::vector<odometry::RgbdFrame> Recording::ReadAll() const {
  std::vector<odometry::RgbdFrame> frames;
  for (std::size_t i = 0; i < size(); ++i) frames.push_back(Read(i));
  return frames;
}

std::optional<Eigen::Isometry3d> Recording::TruthAt(std::size_t index) const {
  return truth_at_[index];
}

nlohmann::ordered_json FiguresOf(const std::vector<datasets::StampedPose>& truth,
                                 const MethodRun& run) {
  nlohmann::ordered_json all;
  try {
    all = evaluation::ToJson(evaluation::EvaluateTrajectory(truth, run.trajectory, {}));
  } catch (const Error&) {
    // No truth, or fewer than two poses of it: its figures stay null.
  }
  nlohmann::ordered_json figures;
  for (const char* key :
       {"ate_rmse_m", "rpe_rmse_m_per_s", "rpe_rmse_deg_per_s", "kitti_translation_percent"}) {
    figures[key] = all.contains(key) ? all[key] : nullptr;
  }
  figures["median_ms"] = evaluation::Quantile(run.milliseconds, 0.5);
  figures["p95_ms"] = evaluation::Quantile(run.milliseconds, 0.95);
  figures["lost"] = run.lost;
  figures["keyframes"] = run.keyframes;
  return figures;
}

nlohmann::ordered_json DescriptionOf(const Recording& recording) {
  nlohmann::ordered_json description;
  description["frames"] = recording.size();
  description["width"] = recording.camera().width;
  description["height"] = recording.camera().height;
  double length_m = 0;
  std::size_t with_truth = 0;
  std::optional<Eigen::Isometry3d> last;
  for (std::size_t i = 0; i < recording.size(); ++i) {
    const std::optional<Eigen::Isometry3d> pose = recording.TruthAt(i);
    if (!pose) continue;
    ++with_truth;
    if (last) length_m += (pose->translation() - last->translation()).norm();
    last = pose;
  }
  description["frames_with_truth"] = with_truth;
  description["length_m"] = length_m;
  return description;
}

}  // namespace livemap::bench
