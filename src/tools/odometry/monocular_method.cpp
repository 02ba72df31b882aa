#include "tools/odometry/monocular_method.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <utility>

#include "common/error.h"
#include "datasets/seeded_random.h"

namespace livemap::tools {
namespace {

using SpeedByStamp = std::map<std::int64_t, double>;

const datasets::StampedPose& NearestTruePose(const std::vector<datasets::StampedPose>& poses,
                                             std::int64_t stamp_ns) {
  return *std::min_element(poses.begin(), poses.end(), [&](const auto& one, const auto& other) {
    return std::abs(one.stamp_ns - stamp_ns) < std::abs(other.stamp_ns - stamp_ns);
  });
}

SpeedByStamp TrueSpeedsForMonocular(const datasets::Sequence& sequence, std::size_t step,
                                    const MonocularOptions& options) {
  if (sequence.poses.size() < 2) {
    throw Error(
        "a single camera takes its metres from the speed between true poses, and the sequence has "
        "none: --scale height does without");
  }
  datasets::SeededRandom random(options.seed);
  SpeedByStamp speeds;
  for (std::size_t i = 0; i < sequence.frames.size(); i += step) {
    const std::size_t before = i >= step ? i - step : i;
    const std::size_t after = i + step < sequence.frames.size() ? i + step : i;
    const datasets::StampedPose& from =
        NearestTruePose(sequence.poses, sequence.frames[before].stamp_ns);
    const datasets::StampedPose& to =
        NearestTruePose(sequence.poses, sequence.frames[after].stamp_ns);
    const double seconds = static_cast<double>(to.stamp_ns - from.stamp_ns) * 1e-9;
    if (!(seconds > 0)) continue;
    const double way_m =
        (to.world_from_camera.translation() - from.world_from_camera.translation()).norm();
    speeds[sequence.frames[i].stamp_ns] =
        std::max(0.0, way_m / seconds + options.speed_sigma_mps * random.Normal().x());
  }
  return speeds;
}

class MonocularMethod : public VoMethod {
 public:
  MonocularMethod(const odometry::MonocularOdometry::Config& config,
                  const geo::CameraIntrinsics& intrinsics, SpeedByStamp speeds)
      : odometry_(config, intrinsics), speeds_(std::move(speeds)) {}

  Step Track(const odometry::RgbdFrame& frame) override {
    odometry::MonocularFrame seen;
    seen.stamp_ns = frame.stamp_ns;
    seen.grey = frame.grey;
    const auto speed = speeds_.find(frame.stamp_ns);
    if (speed != speeds_.end()) seen.speed_mps = speed->second;
    const odometry::VoResult result = odometry_.Track(seen);
    Step step{result.world_from_camera, result.state == odometry::VoState::kLost,
              result.new_keyframe, result.state == odometry::VoState::kInitialising};
    if (!step.initialising && !has_started_) {
      step.origin_stamp_ns = odometry_.start_stamp_ns();
      has_started_ = true;
    }
    return step;
  }

 private:
  odometry::MonocularOdometry odometry_;
  SpeedByStamp speeds_;
  bool has_started_ = false;
};

}  // namespace

std::unique_ptr<VoMethod> MakeMonocularMethod(const MonocularOptions& options,
                                              const odometry::EdgeOdometry::Config& config,
                                              const geo::CameraIntrinsics& intrinsics,
                                              const datasets::Sequence& sequence,
                                              std::size_t step) {
  odometry::MonocularOdometry::Config monocular;
  monocular.odometry.edges = config.edges;
  monocular.odometry.edge_source = config.edge_source;
  monocular.odometry.keyframe_every = config.keyframe_every;
  monocular.scale_source = options.scale_source;
  monocular.speed_sigma_mps = std::max(monocular.speed_sigma_mps, options.speed_sigma_mps);
  monocular.camera_height_m = options.camera_height_m;
  monocular.camera_pitch_rad = options.camera_pitch_rad;
  monocular.keyframe_delay = options.keyframe_delay;
  SpeedByStamp speeds;
  if (options.scale_source == odometry::ScaleSource::kSpeed)
    speeds = TrueSpeedsForMonocular(sequence, step, options);
  return std::make_unique<MonocularMethod>(monocular, intrinsics, std::move(speeds));
}

}  // namespace livemap::tools
