// livemap_evaluate_mounting: how well, and how soon, a camera finds out how it is mounted.

#include <Eigen/Core>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <sstream>
#include <string>

#include "common/error.h"
#include "common/text_file.h"
#include "common/time.h"
#include "datasets/camera_file.h"
#include "datasets/sequences.h"
#include "geo/wgs84.h"
#include "odometry/mounting/mounting_calibrator.h"
#include "odometry/mounting/mounting_file.h"
#include "tools/common/command_line.h"
#include "tools/common/output_path.h"
#include "tools/common/progress.h"
#include "tools/odometry/monocular_method.h"
#include "tools/odometry/sequence_pictures.h"
#include "tools/odometry/vo_method.h"
#include "tools/odometry/vo_sequence.h"

namespace livemap::tools {
namespace {

constexpr char kMountingName[] = "livemap_evaluate_mounting";
/// What placement of hazards needs: docs/explanation/mounting.md.
constexpr double kGoodAngleDeg = 0.3;
constexpr double kGoodHeightM = 0.05;

struct MountingOptions {
  std::string sequence;
  std::string camera_file;
  std::optional<odometry::Mounting> truth;
  bool json = false;
  bool mono = false;
  double seconds = 0;  ///< Of the sequence; 0: all.
  int step = 1;
  MonocularOptions monocular;
  odometry::MountingCalibrator::Config calibrator;
  std::string out;
};

odometry::Mounting ToOdometryMounting(const datasets::CameraMounting& mounting) {
  return {mounting.yaw_deg * geo::kRadiansPerDegree, mounting.pitch_deg * geo::kRadiansPerDegree,
          mounting.roll_deg * geo::kRadiansPerDegree, mounting.height_m};
}

/// The truth that --truth names, or that lies in the sequence's folder.
std::optional<odometry::Mounting> ReadTrueMounting(const CommandLine& line,
                                                   const std::string& sequence) {
  const std::string beside = sequence + "/mounting.yaml";
  if (line.Has("truth")) {
    return ToOdometryMounting(datasets::ReadCameraFile(line.Text("truth", "")).mounting);
  }
  if (!std::filesystem::exists(beside)) return std::nullopt;
  return ToOdometryMounting(datasets::ReadCameraFile(beside).mounting);
}

/// None when --help was asked for and printed.
std::optional<MountingOptions> ParseMountingOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_mounting [FLAGS] SEQ",
      "Follows the camera of a drive by visual odometry, as livemap evaluate vo does, and finds "
      "out\n"
      "how the camera is mounted: yaw and pitch from the direction of travel, roll and pitch from "
      "the\n"
      "road's plane, height from metres. SEQ is a sequence in TUM's or KITTI's layout; the truth "
      "is\n"
      "SEQ/mounting.yaml, which livemap simulate --tum writes. docs/reference/measures.md defines "
      "the\n"
      "figures.",
      1,
      {{"json", "", "one line of JSON instead of a table"},
       {"truth", "FILE", "camera file with the true mounting, default SEQ/mounting.yaml if there"},
       {"camera", "FILE",
        "the camera, laid out as camera.yaml, default the sequence's own or TUM's"},
       {"assume-yaw", "DEG", "what is assumed before; positive looks left, default 0"},
       {"assume-pitch", "DEG", "what is assumed before; positive looks down, default 0"},
       {"assume-roll", "DEG", "what is assumed before; positive: right side down, default 0"},
       {"assume-height", "M", "what is assumed before, over the road, default 1.5"},
       {"camera-forward", "M", "of the camera ahead of base_link, not estimated, default 1.5"},
       {"camera-left", "M", "of the camera left of base_link, not estimated, default 0"},
       {"out", "FILE", "write what was found, as a vehicle keeps it"},
       {"seconds", "S", "use the first seconds of the sequence only, default all"},
       {"step", "N", "use every Nth frame only, default 1"},
       {"mono", "", "monocular: depth is not used where there is some"},
       {"speed-sigma", "M/S", "of monocular: noise added to the speed, default 0"},
       {"seed", "N", "of the speed's noise, default 1"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  line.CheckNeeds({{"seed", line.Has("speed-sigma"), "--speed-sigma, whose noise it is of"}});
  MountingOptions options;
  options.sequence = line.Positional(0);
  options.camera_file = line.Text("camera", "");
  options.json = line.Has("json");
  options.out = line.Text("out", "");
  if (!options.out.empty()) {
    CheckOutputFile("--out", options.out,
                    {options.sequence, line.Text("camera", options.sequence),
                     line.Text("truth", options.sequence)});
  }
  options.mono = line.Has("mono");
  options.seconds = line.Number("seconds", 0, 1, 1e5);
  options.step = line.Whole("step", 1, 1, 1000);
  options.monocular.speed_sigma_mps = line.Number("speed-sigma", 0, 0, 100);
  options.monocular.seed = line.Seed("seed", options.monocular.seed);
  options.truth = ReadTrueMounting(line, options.sequence);
  odometry::MountingCalibrator::Config& calibrator = options.calibrator;
  const auto angle_rad = [&line](const char* flag) {
    return line.Number(flag, 0, -45, 45) * geo::kRadiansPerDegree;
  };
  calibrator.assumed = {angle_rad("assume-yaw"), angle_rad("assume-pitch"),
                        angle_rad("assume-roll"), line.Number("assume-height", 1.5, 0.3, 5)};
  calibrator.forward_m = line.Number("camera-forward", calibrator.forward_m, -20, 20);
  calibrator.left_m = line.Number("camera-left", calibrator.left_m, -5, 5);
  return options;
}

/// An estimate less the truth, degrees and metres.
struct MountingErrors {
  double yaw_deg, pitch_deg, roll_deg, height_m;
  /// Mean over what is known of the squares over the stated variances.
  double nees;
};

MountingErrors ErrorsOfMounting(const odometry::MountingEstimate& estimate,
                                const odometry::Mounting& truth) {
  const odometry::Mounting &found = estimate.mounting, &sigma = estimate.sigma;
  MountingErrors errors{(found.yaw_rad - truth.yaw_rad) / geo::kRadiansPerDegree,
                        (found.pitch_rad - truth.pitch_rad) / geo::kRadiansPerDegree,
                        (found.roll_rad - truth.roll_rad) / geo::kRadiansPerDegree,
                        found.height_m - truth.height_m, 0};
  const auto square = [](double error, double of_sigma) {
    return error * error / (of_sigma * of_sigma);
  };
  int known = 2;
  errors.nees = square(errors.yaw_deg * geo::kRadiansPerDegree, sigma.yaw_rad) +
                square(errors.pitch_deg * geo::kRadiansPerDegree, sigma.pitch_rad);
  if (estimate.roll_known) {
    errors.nees += square(errors.roll_deg * geo::kRadiansPerDegree, sigma.roll_rad);
    ++known;
  }
  if (estimate.height_known) {
    errors.nees += square(errors.height_m, sigma.height_m);
    ++known;
  }
  errors.nees /= known;
  return errors;
}

bool IsGoodMounting(const odometry::MountingEstimate& estimate, const MountingErrors& errors) {
  return estimate.roll_known && estimate.height_known && std::abs(errors.yaw_deg) < kGoodAngleDeg &&
         std::abs(errors.pitch_deg) < kGoodAngleDeg && std::abs(errors.roll_deg) < kGoodAngleDeg &&
         std::abs(errors.height_m) < kGoodHeightM;
}

struct MountingRun {
  std::size_t frames = 0;
  std::size_t lost = 0;
  double seconds = 0;
  std::optional<odometry::MountingEstimate> estimate;
  odometry::MountingCalibrator::Figures figures;
  /// Since when the estimate has been good at every frame; none: it is not.
  std::optional<double> good_since_s;
  std::vector<double> knocked_s;
};

std::unique_ptr<VoMethod> MountingVoMethod(const datasets::Sequence& sequence,
                                           const geo::CameraIntrinsics& camera,
                                           const MountingOptions& options, bool has_depth) {
  const odometry::EdgeOdometry::Config odometry;
  if (has_depth) return MakeVoMethod("edge", odometry, camera);
  return MakeMonocularMethod(options.monocular, odometry, camera, sequence,
                             static_cast<std::size_t>(options.step));
}

MountingRun FindMounting(const datasets::Sequence& sequence, const MountingOptions& options) {
  const geo::CameraIntrinsics camera = IntrinsicsOf(sequence);
  const bool has_depth = !options.mono && !sequence.frames.front().depth_path.empty();
  const auto method = MountingVoMethod(sequence, camera, options, has_depth);
  odometry::MountingCalibrator calibrator(options.calibrator, camera);
  MountingRun run;
  Progress progress("following", sequence.frames.size());
  cv::Mat grey, depth;
  for (std::size_t i = 0; i < sequence.frames.size(); i += static_cast<std::size_t>(options.step)) {
    const datasets::SequenceFrame& source = sequence.frames[i];
    const double time_s = Seconds(source.stamp_ns - sequence.frames.front().stamp_ns);
    if (options.seconds > 0 && time_s > options.seconds) break;
    cv::cvtColor(ReadColourPicture(source.image_path, camera), grey, cv::COLOR_BGR2GRAY);
    if (has_depth) depth = ReadDepthPicture(source.depth_path, camera);
    const VoMethod::Step step = method->Track({source.stamp_ns, grey, depth, sequence.depth_scale});
    ++run.frames;
    run.lost += step.lost ? 1U : 0U;
    run.seconds = time_s;
    odometry::CalibrationFrame frame{source.stamp_ns, grey, step.world_from_camera};
    if (has_depth) depth.convertTo(frame.depth_m, CV_32F, 1 / sequence.depth_scale);
    frame.tracking = !step.lost && !step.initialising;
    calibrator.Add(frame);
    if (calibrator.TakeKnock()) run.knocked_s.push_back(time_s);
    run.estimate = calibrator.Estimate();
    if (options.truth && run.estimate) {
      const bool good =
          IsGoodMounting(*run.estimate, ErrorsOfMounting(*run.estimate, *options.truth));
      if (!good) run.good_since_s.reset();
      if (good && !run.good_since_s) run.good_since_s = time_s;
    }
    progress.At(i + 1);
  }
  run.figures = calibrator.figures();
  return run;
}

nlohmann::ordered_json DegreesOrNull(double rad) {
  if (!std::isfinite(rad)) return nullptr;
  return rad / geo::kRadiansPerDegree;
}

nlohmann::ordered_json MountingReport(const MountingOptions& options, const MountingRun& run) {
  nlohmann::ordered_json json;
  json["frames"] = run.frames;
  json["lost"] = run.lost;
  json["seconds"] = run.seconds;
  json["travel_steps"] = run.figures.travel_steps;
  json["curved_steps"] = run.figures.curved_steps;
  json["planes"] = run.figures.planes;
  json["planes_refused"] = run.figures.planes_refused;
  json["planes_searched"] = run.figures.searches;
  json["knocked_s"] = run.knocked_s;
  for (const char* key :
       {"yaw_deg", "pitch_deg", "roll_deg", "height_m", "yaw_sigma_deg", "pitch_sigma_deg",
        "roll_sigma_deg", "height_sigma_m", "yaw_error_deg", "pitch_error_deg", "roll_error_deg",
        "height_error_m", "nees", "good_since_s"}) {
    json[key] = nullptr;
  }
  if (!run.estimate) {
    json["reason"] = "the vehicle did not drive far enough, nearly straight, to show its direction";
    return json;
  }
  const odometry::MountingEstimate& estimate = *run.estimate;
  const odometry::Mounting &found = estimate.mounting, &sigma = estimate.sigma;
  json["yaw_deg"] = DegreesOrNull(found.yaw_rad);
  json["pitch_deg"] = DegreesOrNull(found.pitch_rad);
  json["yaw_sigma_deg"] = DegreesOrNull(sigma.yaw_rad);
  json["pitch_sigma_deg"] = DegreesOrNull(sigma.pitch_rad);
  if (estimate.roll_known) json["roll_deg"] = DegreesOrNull(found.roll_rad);
  json["roll_sigma_deg"] = DegreesOrNull(sigma.roll_rad);
  if (estimate.height_known) {
    json["height_m"] = found.height_m;
    json["height_sigma_m"] = sigma.height_m;
  }
  if (!options.truth) return json;
  const MountingErrors errors = ErrorsOfMounting(estimate, *options.truth);
  json["yaw_error_deg"] = errors.yaw_deg;
  json["pitch_error_deg"] = errors.pitch_deg;
  if (estimate.roll_known) json["roll_error_deg"] = errors.roll_deg;
  if (estimate.height_known) json["height_error_m"] = errors.height_m;
  json["nees"] = errors.nees;
  if (run.good_since_s) json["good_since_s"] = *run.good_since_s;
  return json;
}

std::string MountingText(const nlohmann::ordered_json& value) {
  if (!value.is_number_float()) return value.dump();
  std::ostringstream text;
  text << std::setprecision(4) << value.get<double>();
  return text.str();
}

int EvaluateMounting(int argc, char** argv) {
  const std::optional<MountingOptions> options = ParseMountingOptions(argc, argv);
  if (!options) return 0;
  cv::setNumThreads(1);
  const datasets::Sequence sequence = ReadVoSequence(
      options->sequence, options->camera_file,
      options->mono ? datasets::DepthImages::kIgnored : datasets::DepthImages::kRead);
  SayNotes(kMountingName, sequence.notes);
  const MountingRun run = FindMounting(sequence, *options);
  const nlohmann::ordered_json report = MountingReport(*options, run);
  if (options->json) {
    std::cout << report.dump() << "\n";
  } else {
    for (const auto& [key, value] : report.items()) {
      std::cout << std::left << std::setw(20) << key << MountingText(value) << "\n";
    }
  }
  if (run.estimate && !options->out.empty()) {
    ReplaceTextFile(options->out,
                    odometry::FormatMountingFile({IntrinsicsOf(sequence), *run.estimate}));
  }
  if (!report.contains("reason")) return 0;
  SayNothingMeasured(kMountingName, report["reason"].get<std::string>());
  return 1;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram(livemap::tools::kMountingName, argc, argv,
                                    livemap::tools::EvaluateMounting);
}
