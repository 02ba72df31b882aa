// livemap_evaluate_vo: how well and how fast visual odometry follows an RGB-D or stereo sequence.

#include <algorithm>
#include <chrono>
#include <cmath>
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
#include "drives/image_file.h"
#include "drives/sequences.h"
#include "evaluation/trajectory_report.h"
#include "tools/command_line.h"
#include "tools/stereo_source.h"
#include "tools/vo_method.h"

namespace livemap {
namespace {

struct Options {
  std::string sequence;
  std::string method = "edge";
  std::string out;
  bool json = false;
  std::optional<StereoConfig> stereo;  ///< None: the sequence's own depth.
  int step = 1;
  EdgeOdometry::Config odometry;
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

/// None when --help was asked for and printed.
std::optional<Options> ParseOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_vo [FLAGS] SEQ",
      "Follows the camera of an RGB-D sequence in TUM layout (associations.txt, camera.yaml,\n"
      "groundtruth.txt if there is one) and prints accuracy and time per frame. Time is that of\n"
      "one thread from the decoded colour picture to the pose, that of stereo depth apart.\n"
      "With --stereo also KITTI's layout (image_0, image_1, calib.txt, poses.txt).\n"
      "docs/evaluation.md defines the figures.",
      1,
      {{"json", "", "one line of JSON instead of a table"},
       {"edges", "KIND", "canny, log, sobel or structured, default canny"},
       {"edge-model", "FILE", "OpenCV's model of --edges structured"},
       {"edge-source", "NAME", "keyframe (default) or new-image (thesis, equation 5.2)"},
       {"keyframe-every", "N", "a keyframe every N frames, 1: frame to frame, default adaptive"},
       {"step", "N", "use every Nth frame only, default 1"},
       {"stereo", "", "depth from the left and right pictures, as camera_ingest computes it"},
       {"stereo-scale", "N", "--stereo matches pictures smaller by 1, 2 (default) or 4"},
       {"method", "NAME", "edge (default), or OpenCV's: rgbd, rgbd-icp"},
       {"out", "FILE", "write the trajectory, TUM lines"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  Options options;
  options.sequence = line.Positional(0);
  options.method = line.Text("method", options.method);
  options.out = line.Text("out", "");
  options.json = line.Has("json");
  options.step = static_cast<int>(line.Number("step", 1, 1, 1000));
  options.odometry.edges.kind = ParseEdgeKind(line.Text("edges", "canny"));
  options.odometry.edges.structured_model = line.Text("edge-model", "");
  options.odometry.edge_source = ReadEdgeSource(line);
  options.stereo = ReadStereo(line);
  if (line.Has("keyframe-every")) {
    options.odometry.keyframe_every = static_cast<int>(line.Number("keyframe-every", 1, 1, 10000));
  }
  return options;
}

cv::Mat ReadPicture(const std::string& path, const CameraIntrinsics& camera, int flags) {
  const ImageFile file = ReadImageFile(path, camera.width, camera.height);
  return cv::imdecode(file.bytes, flags);
}

/// A sequence without width and height has those of its first picture.
CameraIntrinsics IntrinsicsOf(const Sequence& sequence) {
  CameraIntrinsics camera = sequence.intrinsics;
  const ImageFile first = ReadImageFile(sequence.frames.front().image_path, 0, 0);
  if (camera.width == 0) camera.width = static_cast<int>(first.header.width);
  if (camera.height == 0) camera.height = static_cast<int>(first.header.height);
  return camera;
}

/// In TUM's layout, or in KITTI's, which has a calib.txt.
Sequence ReadSequence(const std::string& directory) {
  constexpr double kKittiRateHz = 10;
  const bool kitti = std::filesystem::exists(std::filesystem::path(directory) / "calib.txt");
  return kitti ? ReadKittiSequence(directory, kKittiRateHz) : ReadTumSequence(directory);
}

struct Run {
  std::vector<StampedPose> trajectory;
  std::vector<double> milliseconds;
  std::vector<double> stereo_milliseconds;
  std::size_t lost = 0;
  std::size_t keyframes = 0;
};

Run FollowSequence(const Sequence& sequence, const Options& options) {
  const CameraIntrinsics camera = IntrinsicsOf(sequence);
  const auto method = MakeVoMethod(options.method, options.odometry, camera);
  Run run;
  std::optional<StereoSource> stereo;
  if (options.stereo) stereo.emplace(sequence, camera, *options.stereo);
  Progress progress("following", sequence.frames.size());
  cv::Mat grey;
  for (std::size_t i = 0; i < sequence.frames.size(); i += static_cast<std::size_t>(options.step)) {
    const SequenceFrame& source = sequence.frames[i];
    if (!stereo && source.depth_path.empty()) {
      throw Error("sequence '" + options.sequence +
                  "' has no depth (associations.txt); of a pair of eyes --stereo finds it");
    }
    const cv::Mat colour = ReadPicture(source.image_path, camera, cv::IMREAD_COLOR);
    const cv::Mat depth = stereo ? stereo->Depth(source, colour)
                                 : ReadPicture(source.depth_path, camera, cv::IMREAD_UNCHANGED);
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

double Quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(
      std::lround(share * static_cast<double>(values.size() - 1)))];
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
  const Sequence sequence = ReadSequence(options->sequence);
  const Run run = FollowSequence(sequence, *options);
  if (!options->out.empty()) WriteTrajectory(options->out, run.trajectory);
  const nlohmann::ordered_json report = Report(sequence, *options, run);
  if (options->json) {
    std::cout << report.dump() << "\n";
    return 0;
  }
  for (const char* key :
       {"frames", "lost", "keyframes", "ate_rmse_m", "rpe_rmse_m_per_s", "rpe_rmse_deg_per_s",
        "kitti_translation_percent", "median_ms", "p95_ms", "stereo_ms"}) {
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
