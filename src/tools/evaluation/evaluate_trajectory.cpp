// livemap_evaluate_trajectory: how far an estimated trajectory is from the true one.

#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/error.h"
#include "evaluation/nothing_measured.h"
#include "evaluation/trajectory/trajectory.h"
#include "evaluation/trajectory/trajectory_report.h"
#include "tools/common/command_line.h"

namespace livemap::tools {
namespace {

constexpr char kName[] = "livemap_evaluate_trajectory";

struct Options {
  std::string truth_path;
  std::string estimate_path;
  bool json = false;
  double kitti_rate_hz = 10;
  evaluation::TrajectoryConfig evaluation;
};

evaluation::AlignmentKind ChosenTrajectoryAlignment(const CommandLine& line) {
  const std::string name = line.Text("align", line.Has("scale") ? "sim3" : "se3");
  const std::optional<evaluation::AlignmentKind> kind = evaluation::ParseAlignmentKind(name);
  if (!kind) throw Error("--align is '" + name + "', accepted are none, se3, sim3 and origin");
  if (line.Has("scale") && *kind != evaluation::AlignmentKind::kSim3) {
    throw Error("--scale means --align sim3, but --align is '" + name + "'");
  }
  return *kind;
}

std::size_t TrajectoryDeltaFrames(const CommandLine& line) {
  const double frames = line.Number("delta-frames", 0, 1, 1e6);
  if (frames != std::floor(frames)) {
    throw Error("--delta-frames is '" + line.Text("delta-frames", "") +
                "', accepted is a whole number");
  }
  return static_cast<std::size_t>(frames);
}

/// None when --help was asked for and printed.
std::optional<Options> ParseEvaluateTrajectoryOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_trajectory [FLAGS] TRUTH ESTIMATE",
      "Compares two trajectories: absolute error (ATE) and relative error (RPE) as the TUM RGB-D\n"
      "benchmark's scripts define them, segment errors as the KITTI odometry devkit does. A file "
      "has\n"
      "TUM lines \"stamp tx ty tz qx qy qz qw\" or KITTI lines of 12 numbers, camera to world.\n"
      "docs/reference/measures.md defines the figures.",
      2,
      {{"json", "", "one line of JSON instead of a table"},
       {"align", "KIND", "none, se3, sim3 or origin (first poses on each other), default se3"},
       {"scale", "", "the same as --align sim3: find the estimate's scale too"},
       {"max-difference", "SECONDS", "stamps nearer than this may be a pair, default 0.02"},
       {"offset", "SECONDS", "added to the stamps of ESTIMATE, default 0"},
       {"delta", "SECONDS", "time over which RPE is measured, default 1"},
       {"delta-frames", "N", "RPE also over N poses of ESTIMATE"},
       {"rate", "HZ", "frames per second of KITTI files, which have no stamps, default 10"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  Options options;
  options.truth_path = line.Positional(0);
  options.estimate_path = line.Positional(1);
  options.json = line.Has("json");
  options.kitti_rate_hz = line.Number("rate", options.kitti_rate_hz, 0.01, 10000);
  evaluation::AssociationConfig& association = options.evaluation.association;
  association.max_difference_s =
      line.Number("max-difference", association.max_difference_s, 1e-6, 1000);
  association.offset_s = line.Number("offset", 0, -4e9, 4e9);
  options.evaluation.alignment = ChosenTrajectoryAlignment(line);
  options.evaluation.rpe_delta_s =
      line.Number("delta", options.evaluation.rpe_delta_s, 0.001, 100000);
  options.evaluation.rpe_delta_frames = TrajectoryDeltaFrames(line);
  return options;
}

int EvaluateTrajectoryFiles(int argc, char** argv) {
  const std::optional<Options> options = ParseEvaluateTrajectoryOptions(argc, argv);
  if (!options) return 0;
  std::vector<std::string> notes;
  const std::vector<datasets::StampedPose> truth =
      evaluation::ReadTrajectory(options->truth_path, options->kitti_rate_hz, &notes);
  const std::vector<datasets::StampedPose> estimate =
      evaluation::ReadTrajectory(options->estimate_path, options->kitti_rate_hz, &notes);
  // Without stamps, a line that is missing anywhere shifts all pairs behind it.
  const bool unequal_lengths = truth.size() != estimate.size() &&
                               evaluation::HasKittiLayout(options->truth_path) &&
                               evaluation::HasKittiLayout(options->estimate_path);
  if (unequal_lengths) {
    notes.push_back("'" + options->truth_path + "' has " + std::to_string(truth.size()) +
                    " poses and '" + options->estimate_path + "' " +
                    std::to_string(estimate.size()) +
                    ": they are paired line by line from the first one on");
  }
  SayNotes(kName, notes);
  try {
    const evaluation::TrajectoryFigures figures =
        evaluation::EvaluateTrajectory(truth, estimate, options->evaluation);
    nlohmann::ordered_json json = evaluation::ToJson(figures);
    json["unequal_lengths"] = unequal_lengths;
    std::cout << (options->json ? json.dump() + "\n" : evaluation::ToText(figures));
    return 0;
  } catch (const evaluation::NothingMeasured& nothing) {
    SayNothingMeasured(kName, nothing.what());
    if (options->json) {
      nlohmann::ordered_json json = evaluation::NullFigures();
      json["pairs"] =
          evaluation::Associate(truth, estimate, options->evaluation.association).truth.size();
      json["truth_poses"] = truth.size();
      json["estimate_poses"] = estimate.size();
      json["unequal_lengths"] = unequal_lengths;
      json["reason"] = nothing.what();
      std::cout << json.dump() << "\n";
    }
    return 1;
  }
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_evaluate_trajectory", argc, argv,
                                    livemap::tools::EvaluateTrajectoryFiles);
}
