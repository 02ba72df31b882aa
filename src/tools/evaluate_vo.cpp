// livemap_evaluate_vo: how well and how fast visual odometry follows an RGB-D or stereo sequence.

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <sstream>

#include "base/error.h"
#include "drives/sequences.h"
#include "evaluation/quantile.h"
#include "evaluation/trajectory_report.h"
#include "tools/command_line.h"
#include "tools/monocular_method.h"
#include "tools/sequence_pictures.h"
#include "tools/stereo_source.h"
#include "tools/vo_method.h"

namespace livemap {
namespace {

struct Options {
  std::string sequence;
  std::string camera_file;
  std::string method = "edge";
  std::string out;
  bool json = false;
  std::optional<StereoConfig> stereo;  ///< None: the sequence's own depth.
  int step = 1;
  EdgeOdometry::Config odometry;
  bool mono = false;
  MonocularOptions monocular;
};

EdgeSource ReadEdgeSource(const CommandLine& line) {
  const std::string name = line.Text("edge-source", "keyframe");
  if (name == "keyframe") return EdgeSource::kKeyframe;
  if (name == "new-image") return EdgeSource::kNewImage;
  throw Error("--edge-source is '" + name + "'; accepted are keyframe, new-image");
}

std::optional<StereoConfig> ReadStereo(const CommandLine& line) {
  if (!line.Has("stereo")) {
    if (line.Has("stereo-scale")) throw Error("--stereo-scale needs --stereo, which it is about");
    return std::nullopt;
  }
  StereoConfig config;
  config.scale = static_cast<int>(line.Number("stereo-scale", config.scale, 1, 4));
  return config;
}

MonocularOptions ReadMonocular(const CommandLine& line) {
  MonocularOptions options;
  options.scale_source = ParseScaleSource(line.Text("scale", "speed"));
  options.speed_sigma_mps = line.Number("speed-sigma", 0, 0, 100);
  options.camera_height_m = line.Number("camera-height", options.camera_height_m, 0.01, 100);
  options.camera_pitch_rad = line.Number("camera-pitch", 0, -1, 1);
  options.seed = static_cast<std::uint64_t>(line.Number("seed", 1, 0, 1e9));
  return options;
}

/// None when --help was asked for and printed.
std::optional<Options> ParseOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_vo [FLAGS] SEQ",
      "Follows the camera of a sequence in TUM layout (associations.txt, or rgb.txt with or "
      "without\n"
      "depth.txt; camera.yaml; groundtruth.txt if there is one) or in KITTI's (images, image_0 "
      "and\n"
      "image_1, calib.txt, poses.txt) and prints accuracy and time per frame: by its depth, by "
      "two\n"
      "eyes (--stereo), or by one (--mono, and always where there is no depth). Time is that of "
      "one\n"
      "thread from the decoded colour picture to the pose, that of stereo depth apart.\n"
      "docs/evaluation.md defines the figures.",
      1,
      {{"json", "", "one line of JSON instead of a table"},
       {"edges", "KIND", "canny, log, sobel or structured, default canny"},
       {"edge-model", "FILE", "OpenCV's model of --edges structured"},
       {"edge-source", "NAME", "keyframe (default) or new-image (thesis, equation 5.2)"},
       {"keyframe-every", "N", "a keyframe every N frames, 1: frame to frame, default adaptive"},
       {"camera", "FILE",
        "the camera, laid out as camera.yaml, default the sequence's own or TUM's"},
       {"step", "N", "use every Nth frame only, default 1"},
       {"stereo", "", "depth from the left and right pictures, as camera_ingest computes it"},
       {"stereo-scale", "N", "--stereo matches pictures smaller by 1, 2 (default) or 4"},
       {"mono", "", "one eye only: depth is not used where there is some"},
       {"scale", "NAME",
        "what tells one eye metres: speed (default; that of the true poses) or height"},
       {"speed-sigma", "M/S", "noise added to the speed, default 0"},
       {"camera-height", "M", "of --scale height: over the road, default 1.65"},
       {"camera-pitch", "RAD", "of --scale height: positive looks down, default 0"},
       {"seed", "N", "of the speed's noise, default 1"},
       {"method", "NAME", "edge (default), or OpenCV's: rgbd, rgbd-icp"},
       {"out", "FILE", "write the trajectory, TUM lines"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  Options options;
  options.sequence = line.Positional(0);
  options.camera_file = line.Text("camera", "");
  options.method = line.Text("method", options.method);
  options.out = line.Text("out", "");
  options.json = line.Has("json");
  options.step = static_cast<int>(line.Number("step", 1, 1, 1000));
  options.odometry.edges.kind = ParseEdgeKind(line.Text("edges", "canny"));
  options.odometry.edges.structured_model = line.Text("edge-model", "");
  options.odometry.edge_source = ReadEdgeSource(line);
  options.stereo = ReadStereo(line);
  options.mono = line.Has("mono");
  options.monocular = ReadMonocular(line);
  if (line.Has("keyframe-every")) {
    options.odometry.keyframe_every = static_cast<int>(line.Number("keyframe-every", 1, 1, 10000));
  }
  return options;
}

/// In TUM's layout, or in KITTI's, which has a calib.txt.
Sequence ReadSequence(const Options& options) {
  constexpr double kKittiRateHz = 10;
  const bool kitti = std::filesystem::exists(std::filesystem::path(options.sequence) / "calib.txt");
  return kitti ? ReadKittiSequence(options.sequence, kKittiRateHz)
               : ReadTumSequence(options.sequence, options.camera_file);
}

struct Run {
  std::vector<StampedPose> trajectory;
  std::vector<double> milliseconds;
  std::vector<double> stereo_milliseconds;
  std::size_t lost = 0;
  std::size_t keyframes = 0;
};

/// Whether one eye is all there is, or all that was asked for.
bool IsMonocular(const Sequence& sequence, const Options& options) {
  if (options.stereo) return false;
  return options.mono || sequence.frames.front().depth_path.empty();
}

std::unique_ptr<VoMethod> MethodFor(const Sequence& sequence, const CameraIntrinsics& camera,
                                    const Options& options) {
  if (!IsMonocular(sequence, options)) {
    return MakeVoMethod(options.method, options.odometry, camera);
  }
  if (options.method != "edge") {
    throw Error("--method " + options.method + " needs depth, which '" + options.sequence +
                "' is followed without");
  }
  return MakeMonocularMethod(options.monocular, options.odometry, camera, sequence,
                             static_cast<std::size_t>(options.step));
}

Run FollowSequence(const Sequence& sequence, const Options& options) {
  const CameraIntrinsics camera = IntrinsicsOf(sequence);
  const auto method = MethodFor(sequence, camera, options);
  const bool has_depth = !IsMonocular(sequence, options) && !options.stereo;
  Run run;
  std::optional<StereoSource> stereo;
  if (options.stereo) stereo.emplace(sequence, camera, *options.stereo);
  Progress progress("following", sequence.frames.size());
  cv::Mat grey, depth;
  for (std::size_t i = 0; i < sequence.frames.size(); i += static_cast<std::size_t>(options.step)) {
    const SequenceFrame& source = sequence.frames[i];
    if (has_depth && source.depth_path.empty()) {
      throw Error("'" + source.image_path + "' has no depth, but the pictures before it have");
    }
    const cv::Mat colour = ReadPicture(source.image_path, camera, cv::IMREAD_COLOR);
    if (stereo) depth = stereo->Depth(source, colour);
    if (has_depth) depth = ReadPicture(source.depth_path, camera, cv::IMREAD_UNCHANGED);
    if (stereo) run.stereo_milliseconds.push_back(stereo->milliseconds());
    const auto start = std::chrono::steady_clock::now();
    cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
    const VoMethod::Step step = method->Track({source.stamp_ns, grey, depth, sequence.depth_scale});
    run.milliseconds.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    run.trajectory.push_back({source.stamp_ns, step.world_from_camera});
    run.lost += step.lost ? 1U : 0U;
    run.keyframes += step.keyframe ? 1U : 0U;
    progress.At(i + 1);
  }
  return run;
}

void WriteTrajectory(const std::string& path, const std::vector<StampedPose>& trajectory) {
  std::ofstream file(path);
  file << "# timestamp tx ty tz qx qy qz qw (camera to world)\n";
  for (const StampedPose& pose : trajectory) {
    const Eigen::Quaterniond q(pose.world_from_camera.linear());
    const Eigen::Vector3d t = pose.world_from_camera.translation();
    file << pose.stamp_ns / 1'000'000'000 << '.' << std::setw(9) << std::setfill('0')
         << pose.stamp_ns % 1'000'000'000 << std::setprecision(9);
    for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
      file << ' ' << value;
    }
    file << '\n';
  }
  file.close();
  if (!file) throw Error("the trajectory '" + path + "' cannot be written");
}

nlohmann::ordered_json Report(const Sequence& sequence, const Options& options, const Run& run) {
  nlohmann::ordered_json json;
  if (sequence.poses.empty()) {
    for (const char* key : {"ate_rmse_m", "rpe_rmse_m_per_s", "rpe_rmse_deg_per_s"}) {
      json[key] = nullptr;
    }
  } else {
    json = ToJson(EvaluateTrajectory(sequence.poses, run.trajectory, {}));
  }
  json["median_ms"] = Quantile(run.milliseconds, 0.5);
  json["p95_ms"] = Quantile(run.milliseconds, 0.95);
  if (options.stereo) json["stereo_ms"] = Quantile(run.stereo_milliseconds, 0.5);
  json["frames"] = run.trajectory.size();
  json["lost"] = run.lost;
  json["keyframes"] = run.keyframes;
  json["method"] = options.method;
  json["depth"] = options.stereo ? "stereo" : IsMonocular(sequence, options) ? "mono" : "images";
  return json;
}

/// Four digits of what is measured; counts whole.
std::string Text(const nlohmann::ordered_json& value) {
  if (!value.is_number_float()) return value.dump();
  std::ostringstream text;
  text << std::setprecision(4) << value.get<double>();
  return text.str();
}

int RunEvaluation(int argc, char** argv) {
  const std::optional<Options> options = ParseOptions(argc, argv);
  if (!options) return 0;
  cv::setNumThreads(1);
  const Sequence sequence = ReadSequence(*options);
  const Run run = FollowSequence(sequence, *options);
  if (!options->out.empty()) WriteTrajectory(options->out, run.trajectory);
  const nlohmann::ordered_json report = Report(sequence, *options, run);
  if (options->json) {
    std::cout << report.dump() << "\n";
    return 0;
  }
  for (const char* key :
       {"frames", "lost", "keyframes", "ate_rmse_m", "rpe_rmse_m_per_s", "rpe_rmse_deg_per_s",
        "kitti_translation_percent", "segment_translation_percent", "end_error_percent",
        "median_ms", "p95_ms", "stereo_ms"}) {
    if (report.contains(key)) {
      std::cout << std::left << std::setw(28) << std::setfill(' ') << key << Text(report[key])
                << "\n";
    }
  }
  return 0;
}

}  // namespace
}  // namespace livemap

int main(int argc, char** argv) {
  return livemap::RunProgram("livemap_evaluate_vo", argc, argv, livemap::RunEvaluation);
}
