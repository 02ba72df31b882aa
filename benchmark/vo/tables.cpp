#include <limits>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>
#include <vector>

#include "evaluation/trajectory/trajectory_alignment.h"
#include "measurements.h"
#include "thread_time.h"
#include "tools/common/progress.h"
#include "tools/odometry/vo_method.h"

namespace livemap::bench {
namespace {

/// As many frames as the thesis found a keyframe good for (section 5.2.6), and one more.
constexpr int kEveryFifth = 5;

struct Variant {
  std::vector<std::pair<std::string, std::string>> name;  // Keys of its row.
  std::unique_ptr<tools::VoMethod> method;
  MethodRun run;
};

std::vector<odometry::EdgeKind> KindsOf(const std::string& edge_model) {
  std::vector<odometry::EdgeKind> kinds = {odometry::EdgeKind::kCanny,
                                           odometry::EdgeKind::kLaplacianOfGaussian,
                                           odometry::EdgeKind::kSobel};
  if (!edge_model.empty()) kinds.push_back(odometry::EdgeKind::kStructured);
  return kinds;
}

const char* KeyframesName(int keyframe_every) {
  return keyframe_every == 0 ? "adaptive" : keyframe_every == 1 ? "frame-to-frame" : "every-5";
}

void SwitchOffAdaptiveRules(odometry::EdgeOdometry::Config& config) {
  config.keyframe_motion = std::numeric_limits<double>::infinity();
  config.keyframe_sigma_ratio = std::numeric_limits<double>::infinity();
  config.keyframe_overlap = 0;
}

std::vector<Variant> MakeVariants(const geo::CameraIntrinsics& camera,
                                  const std::string& edge_model) {
  std::vector<Variant> variants;
  for (const odometry::EdgeKind kind : KindsOf(edge_model)) {
    for (const odometry::EdgeSource source :
         {odometry::EdgeSource::kKeyframe, odometry::EdgeSource::kNewImage}) {
      for (const int keyframe_every : {0, kEveryFifth, 1}) {
        odometry::EdgeOdometry::Config config;
        config.edges.kind = kind;
        config.edges.structured_model = edge_model;
        config.edge_source = source;
        config.keyframe_every = keyframe_every;
        if (keyframe_every == kEveryFifth) SwitchOffAdaptiveRules(config);
        Variant variant;
        variant.name = {
            {"method", "edge"},
            {"edges", odometry::EdgeKindName(kind)},
            {"source", source == odometry::EdgeSource::kKeyframe ? "keyframe" : "new-image"},
            {"keyframe_rule", KeyframesName(keyframe_every)}};
        variant.method = tools::MakeVoMethod("edge", config, camera);
        variants.push_back(std::move(variant));
      }
    }
  }
  for (const char* name : {"rgbd", "rgbd-icp"}) {
    Variant variant;
    variant.name = {{"method", name}};
    variant.method = tools::MakeVoMethod(name, {}, camera);
    variants.push_back(std::move(variant));
  }
  return variants;
}

void Track(const cv::Mat& colour, odometry::RgbdFrame frame, Variant& variant) {
  const double start_ms = ThreadTimeMs();
  cv::cvtColor(colour, frame.grey, cv::COLOR_BGR2GRAY);
  const tools::VoMethod::Step step = variant.method->Track(frame);
  variant.run.milliseconds.push_back(ThreadTimeMs() - start_ms);
  variant.run.trajectory.push_back({frame.stamp_ns, step.world_from_camera});
  variant.run.lost += step.lost ? 1U : 0U;
  variant.run.keyframes += step.keyframe ? 1U : 0U;
}

/// Positions in the truth's frame, moved onto it.
nlohmann::ordered_json PathOf(const evaluation::TrajectoryPairs& pairs) {
  const evaluation::Alignment alignment = Align(pairs, evaluation::AlignmentKind::kSe3);
  nlohmann::ordered_json path = nlohmann::json::array();
  for (const datasets::StampedPose& pose : pairs.estimate) {
    const Eigen::Vector3d at = alignment(pose.world_from_camera.translation());
    path.push_back({at.x(), at.y(), at.z()});
  }
  return path;
}

nlohmann::ordered_json PathsOf(const Recording& recording, const std::vector<Variant>& variants) {
  nlohmann::ordered_json paths;
  for (const Variant& variant : variants) {
    const bool is_default = &variant == &variants.front();
    if (!is_default && variant.name.front().second != "rgbd") continue;
    const evaluation::TrajectoryPairs pairs =
        evaluation::Associate(recording.truth(), variant.run.trajectory, {});
    if (pairs.truth.size() < 2) return nullptr;
    if (is_default) {
      for (const datasets::StampedPose& pose : pairs.truth) {
        const Eigen::Vector3d& at = pose.world_from_camera.translation();
        paths["truth"].push_back({at.x(), at.y(), at.z()});
        paths["time_s"].push_back(
            static_cast<double>(pose.stamp_ns - pairs.truth.front().stamp_ns) * 1e-9);
      }
    }
    paths[is_default ? "edge" : "rgbd"] = PathOf(pairs);
  }
  return paths;
}

}  // namespace

nlohmann::ordered_json MeasureTables(const Recording& recording, const std::string& edge_model) {
  std::vector<Variant> variants = MakeVariants(recording.camera(), edge_model);
  tools::Progress progress("tables", recording.size());
  for (std::size_t i = 0; i < recording.size(); ++i) {
    const cv::Mat colour = recording.ReadColour(i);
    const odometry::RgbdFrame frame = recording.ReadDepth(i);
    for (std::size_t k = 0; k < variants.size(); ++k) {
      Track(colour, frame, variants[(i + k) % variants.size()]);
    }
    progress.At(i + 1);
  }
  nlohmann::ordered_json json = DescriptionOf(recording);
  for (const Variant& variant : variants) {
    nlohmann::ordered_json row;
    for (const auto& [key, value] : variant.name) row[key] = value;
    row.update(FiguresOf(recording.truth(), variant.run));
    json["rows"].push_back(row);
  }
  json["paths"] = PathsOf(recording, variants);
  return json;
}

}  // namespace livemap::bench
