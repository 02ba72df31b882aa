// livemap_evaluate_vo: how well and how fast visual odometry follows an RGB-D or stereo sequence.

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <sstream>

#include "common/error.h"
#include "datasets/sequences.h"
#include "evaluation/nothing_measured.h"
#include "evaluation/quantile.h"
#include "evaluation/trajectory/trajectory_report.h"
#include "odometry/mounting/mounting_file.h"
#include "tools/common/command_line.h"
#include "tools/common/output_path.h"
#include "tools/common/progress.h"
#include "tools/odometry/monocular_method.h"
#include "tools/odometry/sequence_pictures.h"
#include "tools/odometry/stereo_source.h"
#include "tools/odometry/vo_method.h"
#include "tools/odometry/vo_sequence.h"

namespace livemap::tools {
namespace {

constexpr char kName[] = "livemap_evaluate_vo";

struct Options {
  std::string sequence;
  std::string camera_file;
  std::string method = "edge";
  std::string out;
  bool json = false;
  std::optional<imaging::StereoConfig> stereo;  ///< None: the sequence's own depth.
  int step = 1;
  odometry::EdgeOdometry::Config odometry;
  bool mono = false;
  MonocularOptions monocular;
  std::string
      monocular_flag;  ///< One that was given and is about monocular odometry only, or none.
};

odometry::EdgeSource ReadVoEdgeSource(const CommandLine& line) {
  const std::string name = line.Text("edge-source", "keyframe");
  if (name == "keyframe") return odometry::EdgeSource::kKeyframe;
  if (name == "new-image" || name == "new_image") return odometry::EdgeSource::kNewImage;
  throw Error("--edge-source is '" + name + "'; accepted are keyframe, new-image");
}

std::optional<imaging::StereoConfig> ReadStereoVo(const CommandLine& line) {
  if (!line.Has("stereo")) return std::nullopt;
  imaging::StereoConfig config;
  config.scale = line.Whole("stereo-scale", config.scale, 1, 4);
  return config;
}

MonocularOptions ReadMonocularVo(const CommandLine& line) {
  MonocularOptions options;
  options.scale_source = odometry::ParseScaleSource(line.Text("scale", "speed"));
  options.speed_sigma_mps = line.Number("speed-sigma", 0, 0, 100);
  options.camera_height_m = line.Number("camera-height", options.camera_height_m, 0.01, 100);
  if (line.Has("camera-pitch")) {
    options.camera_pitch_rad = line.Number("camera-pitch", 0, -1, 1);
  }
  options.seed = line.Seed("seed", options.seed);
  if (line.Has("mounting")) {
    const std::string path = line.Text("mounting", "");
    const odometry::MountingEstimate found = odometry::ReadMountingFile(path).estimate;
    if (!found.height_known) {
      throw Error("--mounting '" + path + "' has no height_m: it was found without a speed");
    }
    options.camera_height_m = found.mounting.height_m;
    options.camera_pitch_rad = found.mounting.pitch_rad;
  }
  options.keyframe_delay = line.Whole("keyframe-delay", options.keyframe_delay, 0, 1000);
  return options;
}

odometry::EdgeExtractor::Config ReadVoEdges(const CommandLine& line) {
  odometry::EdgeExtractor::Config edges;
  edges.kind = odometry::ParseEdgeKind(line.Text("edges", "canny"));
  edges.structured_model = line.Text("edge-model", "");
  const bool has_model = std::filesystem::is_regular_file(edges.structured_model);
  if (line.Has("edge-model") && !has_model) {
    throw Error("--edge-model is '" + edges.structured_model + "', which is no file");
  }
  return edges;
}

/// Flags that would be passed over, and those that contradict each other, are refused. Whether a
/// sequence has depth is not known yet.
void CheckVoFlags(const CommandLine& line) {
  const bool ours = line.Text("method", "edge") == "edge";
  const bool structured = line.Text("edges", "canny") == "structured";
  const bool height = line.Text("scale", "speed") == "height";
  const std::string edge_method = "--method edge, which alone has such";
  line.CheckNeeds({{"edges", ours, edge_method},
                   {"edge-source", ours, edge_method},
                   {"keyframe-every", ours, edge_method},
                   {"edge-model", structured, "--edges structured, which it is for"},
                   {"mono", !line.Has("stereo"), "--stereo left out: monocular or stereo"},
                   {"stereo-scale", line.Has("stereo"), "--stereo, which it is about"},
                   {"speed-sigma", !height, "--scale speed: the height knows no speed"},
                   {"seed", line.Has("speed-sigma"), "--speed-sigma, whose noise it is of"},
                   {"camera-height", height, "--scale height, which it is about"},
                   {"camera-pitch", height, "--scale height, which it is about"},
                   {"mounting", height, "--scale height, which it is about"}});
  if (line.Has("mounting") && (line.Has("camera-height") || line.Has("camera-pitch"))) {
    throw Error("--mounting states height and pitch: leave out --camera-height and --camera-pitch");
  }
  if (structured && !line.Has("edge-model")) {
    throw Error("--edges structured needs --edge-model FILE, OpenCV's model of them");
  }
}

/// None when --help was asked for and printed.
std::optional<Options> ParseEvaluateVoOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_vo [FLAGS] SEQ",
      "Follows the camera of a sequence in TUM layout (associations.txt, or rgb.txt with or "
      "without\n"
      "depth.txt; camera.yaml; groundtruth.txt if there is one) or in KITTI's (images, image_0 "
      "and\n"
      "image_1, calib.txt, poses.txt) and prints accuracy and time per frame: by its depth, by "
      "two\n"
      "cameras (--stereo), or monocular (--mono, and always where there is no depth). Time is that "
      "of "
      "one\n"
      "thread from the decoded colour picture to the pose, that of stereo depth apart.\n"
      "docs/reference/measures.md defines the figures.",
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
       {"mono", "", "monocular: depth is not used where there is some"},
       {"scale", "NAME",
        "what gives monocular odometry its scale: speed (default; that of the true poses) or "
        "height"},
       {"speed-sigma", "M/S", "of --scale speed: noise added to the speed, default 0"},
       {"camera-height", "M", "of --scale height: over the road, default 1.65"},
       {"camera-pitch", "RAD",
        "of --scale height: positive looks down, default: as it sees the direction of travel"},
       {"mounting", "FILE",
        "of --scale height: height and pitch as livemap evaluate mounting --out found them"},
       {"seed", "N", "of the speed's noise, default 1"},
       {"keyframe-delay", "N",
        "monocular: frames until a keyframe is taken over, as on board, where it is made beside "
        "them; default 0"},
       {"method", "NAME", "edge (default), or OpenCV's: rgbd, rgbd-icp"},
       {"out", "FILE", "write the trajectory, TUM lines"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  CheckVoFlags(line);
  Options options;
  options.sequence = line.Positional(0);
  options.camera_file = line.Text("camera", "");
  options.method = line.Text("method", options.method);
  options.out = line.Text("out", "");
  if (!options.out.empty()) {
    CheckOutputFile("--out", options.out,
                    {options.sequence, line.Text("camera", options.sequence)});
  }
  options.json = line.Has("json");
  options.step = line.Whole("step", 1, 1, 1000);
  options.odometry.edges = ReadVoEdges(line);
  options.odometry.edge_source = ReadVoEdgeSource(line);
  options.stereo = ReadStereoVo(line);
  options.mono = line.Has("mono");
  options.monocular = ReadMonocularVo(line);
  for (const char* flag : {"scale", "speed-sigma", "keyframe-delay"}) {
    if (line.Has(flag)) options.monocular_flag = flag;
  }
  options.odometry.keyframe_every = line.Whole("keyframe-every", 0, 1, 10000);
  return options;
}

struct Run {
  std::vector<datasets::StampedPose> trajectory;  ///< Without the frames before the start.
  std::vector<double> milliseconds;               ///< Of every frame.
  std::vector<double> stereo_milliseconds;
  std::size_t initialising = 0;
  std::size_t lost = 0;
  std::size_t keyframes = 0;
};

/// Whether monocular is all that is possible, or all that was asked for.
bool IsMonocularVo(const datasets::Sequence& sequence, const Options& options) {
  if (options.stereo) return false;
  return options.mono || sequence.frames.front().depth_path.empty();
}

/// The frame's part of the run; poses begin with the frame at the origin.
void AddVoStep(const VoMethod::Step& step, std::int64_t stamp_ns, Run& run) {
  run.lost += step.lost ? 1U : 0U;
  run.keyframes += step.keyframe ? 1U : 0U;
  if (step.initialising) {
    ++run.initialising;
    return;
  }
  if (step.origin_stamp_ns) {
    --run.initialising;
    run.trajectory.push_back({*step.origin_stamp_ns, Eigen::Isometry3d::Identity()});
  }
  run.trajectory.push_back({stamp_ns, step.world_from_camera});
}

std::unique_ptr<VoMethod> VoMethodFor(const datasets::Sequence& sequence,
                                      const geo::CameraIntrinsics& camera, const Options& options) {
  if (!IsMonocularVo(sequence, options)) {
    if (!options.monocular_flag.empty()) {
      throw Error("--" + options.monocular_flag +
                  (options.monocular_flag == "keyframe-delay"
                       ? " delays the keyframes of monocular odometry"
                       : " gives monocular odometry its scale") +
                  ": it needs --mono, or a sequence without depth");
    }
    return MakeVoMethod(options.method, options.odometry, camera);
  }
  if (options.method != "edge") {
    throw Error("--method " + options.method + " needs depth, which '" + options.sequence +
                "' is followed without");
  }
  return MakeMonocularMethod(options.monocular, options.odometry, camera, sequence,
                             static_cast<std::size_t>(options.step));
}

Run FollowSequenceByVo(const datasets::Sequence& sequence, const Options& options) {
  const geo::CameraIntrinsics camera = IntrinsicsOf(sequence);
  const auto method = VoMethodFor(sequence, camera, options);
  const bool has_depth = !IsMonocularVo(sequence, options) && !options.stereo;
  Run run;
  std::optional<StereoSource> stereo;
  if (options.stereo) stereo.emplace(sequence, camera, *options.stereo);
  Progress progress("following", sequence.frames.size());
  cv::Mat grey, depth;
  for (std::size_t i = 0; i < sequence.frames.size(); i += static_cast<std::size_t>(options.step)) {
    const datasets::SequenceFrame& source = sequence.frames[i];
    if (has_depth && source.depth_path.empty()) {
      throw Error("'" + source.image_path + "' has no depth, but the pictures before it have");
    }
    const cv::Mat colour = ReadColourPicture(source.image_path, camera);
    if (stereo) depth = stereo->Depth(source, colour);
    if (has_depth) depth = ReadDepthPicture(source.depth_path, camera);
    if (stereo) run.stereo_milliseconds.push_back(stereo->milliseconds());
    const auto start = std::chrono::steady_clock::now();
    cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
    const VoMethod::Step step = method->Track({source.stamp_ns, grey, depth, sequence.depth_scale});
    run.milliseconds.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    AddVoStep(step, source.stamp_ns, run);
    progress.At(i + 1);
  }
  return run;
}

/// Before the work, not after it. What the file holds stays until then, and none is left behind.
void CheckVoOutput(const std::string& path) {
  std::error_code ignored;
  const bool was_there = std::filesystem::exists(path, ignored);
  if (!std::ofstream(path, std::ios::app)) {
    throw Error("--out is '" + path + "', which cannot be written");
  }
  if (!was_there) std::filesystem::remove(path, ignored);
}

void WriteVoTrajectory(const std::string& path,
                       const std::vector<datasets::StampedPose>& trajectory) {
  std::ofstream file(path);
  file << "# timestamp tx ty tz qx qy qz qw (camera to world)\n";
  for (const datasets::StampedPose& pose : trajectory) {
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

std::string WhyItNeverStarted(const datasets::Sequence& sequence, const Options& options,
                              const Run& run) {
  return "visual odometry never started in " + std::to_string(run.milliseconds.size()) +
         " frames: " +
         (IsMonocularVo(sequence, options)
              ? "a monocular camera must move far enough, in small steps, to see depth"
              : "no frame has enough edges with depth") +
         "; there are no poses, and the errors are null";
}

/// What the trajectory is worth; null with a reason where nothing can be measured though there is
/// truth.
nlohmann::ordered_json ErrorsOf(const datasets::Sequence& sequence, const Options& options,
                                const Run& run) {
  nlohmann::ordered_json json = evaluation::NullFigures();
  if (run.trajectory.empty()) {
    json["reason"] = WhyItNeverStarted(sequence, options, run);
    return json;
  }
  // Its times are figures, too: without truth they are what was asked for.
  if (sequence.poses.empty()) return json;
  try {
    return evaluation::ToJson(evaluation::EvaluateTrajectory(sequence.poses, run.trajectory, {}));
  } catch (const evaluation::NothingMeasured& nothing) {
    json["reason"] = nothing.what();
    return json;
  }
}

nlohmann::ordered_json Report(const datasets::Sequence& sequence, const Options& options,
                              const Run& run) {
  nlohmann::ordered_json json = ErrorsOf(sequence, options, run);
  json["median_ms"] = evaluation::Quantile(run.milliseconds, 0.5);
  json["p95_ms"] = evaluation::Quantile(run.milliseconds, 0.95);
  if (options.stereo) json["stereo_ms"] = evaluation::Quantile(run.stereo_milliseconds, 0.5);
  json["frames"] = run.milliseconds.size();
  json["initialising"] = run.initialising;
  json["lost"] = run.lost;
  json["keyframes"] = run.keyframes;
  json["method"] = options.method;
  json["depth"] = options.stereo ? "stereo" : IsMonocularVo(sequence, options) ? "mono" : "images";
  if (json.contains("reason")) {  // At the end, where people look.
    const nlohmann::ordered_json reason = json["reason"];
    json.erase("reason");
    json["reason"] = reason;
  }
  return json;
}

/// Four digits of what is measured; counts whole.
std::string VoReportText(const nlohmann::ordered_json& value) {
  if (!value.is_number_float()) return value.dump();
  std::ostringstream text;
  text << std::setprecision(4) << value.get<double>();
  return text.str();
}

void PrintVoReport(const nlohmann::ordered_json& report) {
  for (const char* key :
       {"frames", "initialising", "lost", "keyframes", "ate_rmse_m", "rpe_rmse_m_per_s",
        "rpe_rmse_deg_per_s", "kitti_translation_percent", "segment_translation_percent",
        "end_error_percent", "median_ms", "p95_ms", "stereo_ms"}) {
    if (report.contains(key)) {
      std::cout << std::left << std::setw(28) << std::setfill(' ') << key
                << VoReportText(report[key]) << "\n";
    }
  }
}

int EvaluateVo(int argc, char** argv) {
  const std::optional<Options> options = ParseEvaluateVoOptions(argc, argv);
  if (!options) return 0;
  cv::setNumThreads(1);
  const bool wants_depth = !options->mono && !options->stereo;
  const datasets::Sequence sequence =
      ReadVoSequence(options->sequence, options->camera_file,
                     wants_depth ? datasets::DepthImages::kRead : datasets::DepthImages::kIgnored);
  SayNotes(kName, sequence.notes);
  if (!options->out.empty()) CheckVoOutput(options->out);
  const Run run = FollowSequenceByVo(sequence, *options);
  const nlohmann::ordered_json report = Report(sequence, *options, run);
  if (options->json) {
    std::cout << report.dump() << "\n";
  } else {
    PrintVoReport(report);
  }
  if (!options->out.empty()) WriteVoTrajectory(options->out, run.trajectory);
  if (!report.contains("reason")) return 0;
  SayNothingMeasured(kName, report["reason"].get<std::string>());
  return 1;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_evaluate_vo", argc, argv, livemap::tools::EvaluateVo);
}
