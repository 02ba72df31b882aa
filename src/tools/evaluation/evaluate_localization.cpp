// livemap_evaluate_localization: how well fixes and odometry are fused, on a recorded drive.

#include <algorithm>
#include <iostream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "common/error.h"
#include "common/time.h"
#include "datasets/comma2k19.h"
#include "datasets/text_parsing.h"
#include "evaluation/trajectory/localization_evaluation.h"
#include "geo/wgs84.h"
#include "tools/common/command_line.h"

namespace livemap::tools {
namespace {

struct Options {
  std::string folder;
  bool json = false;
  evaluation::LocalizationTrial trial;
  localization::LocalizerConfig config;
};

void ReadLocalizationDropout(const std::string& text, evaluation::LocalizationTrial& trial) {
  const std::vector<std::string> parts = datasets::Split(text, ',');
  const auto start_s = parts.size() == 2 ? datasets::ParseFinite(parts[0]) : std::nullopt;
  const auto length_s = parts.size() == 2 ? datasets::ParseFinite(parts[1]) : std::nullopt;
  if (!start_s || !length_s || *start_s < 0 || *length_s <= 0 || *start_s > 1e6 ||
      *length_s > 1e6) {
    throw Error("--dropout-s is '" + text + "', accepted is START,LENGTH in seconds, e.g. 30,10");
  }
  trial.dropout_start_s = *start_s;
  trial.dropout_s = *length_s;
}

/// None when --help was asked for and printed.
std::optional<Options> ParseEvaluateLocalizationOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_localization [FLAGS] DIR",
      "Fuses the fixes of a recorded drive with odometry from its wheel speed and a simulated "
      "gyro,\n"
      "and compares with the true poses. DIR holds gnss_ublox.csv, pose.csv and can_speed.csv as\n"
      "in comma2k19. docs/reference/measures.md defines the figures.",
      1,
      {{"json", "", "one line of JSON instead of a table"},
       {"noise-m", "X", "white noise added to the fixes, sigma per axis, m, default 0"},
       {"outliers", "SHARE", "of the fixes that are moved away, 0 to 1, default 0"},
       {"outlier-m", "X", "how far, m, default 30"},
       {"dropout-s", "START,LENGTH", "no fixes then, s after the first fix, default none"},
       {"latency-s", "X", "the receiver's latency as a parameter, s, default 0.08"},
       {"latency-sigma-s", "X", "how certain that is, s, default 0.04; 0: not estimated"},
       {"fix-sigma-m", "X",
        "what the receiver states per axis without added noise, m, default 0.5"},
       {"shared-sigma-m", "X", "part of it that neighbouring fixes share, m, default 0.4"},
       {"hide-noise", "", "the stated covariance does not tell of --noise-m"},
       {"gyro-bias-dps", "X", "sigma of the gyro's bias, deg/s, default 0.05"},
       {"gyro-walk-deg", "X", "sigma of the heading's random walk after 1 s, deg, default 0.02"},
       {"window-s", "X", "length of the window, s, default 30"},
       {"seed", "N", "of all noise, default 1"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  Options options;
  line.CheckNeeds({{"outlier-m", line.Has("outliers"), "--outliers, which says how many"},
                   {"hide-noise", line.Has("noise-m"), "--noise-m, which it hides"}});
  options.folder = line.Positional(0);
  options.json = line.Has("json");
  evaluation::LocalizationTrial& trial = options.trial;
  trial.noise_m = line.Number("noise-m", trial.noise_m, 0, 1000);
  trial.outlier_share = line.Number("outliers", trial.outlier_share, 0, 1);
  trial.outlier_m = line.Number("outlier-m", trial.outlier_m, 0, 10000);
  if (line.Has("dropout-s")) ReadLocalizationDropout(line.Text("dropout-s", ""), trial);
  trial.fix_sigma_m = line.Number("fix-sigma-m", trial.fix_sigma_m, 0.01, 100);
  trial.states_noise = !line.Has("hide-noise");
  trial.gyro_bias_sigma_rps = geo::kRadiansPerDegree * line.Number("gyro-bias-dps", 0.05, 0, 10);
  trial.gyro_walk_rad = geo::kRadiansPerDegree * line.Number("gyro-walk-deg", 0.02, 0, 10);
  trial.seed = line.Seed("seed", trial.seed);
  localization::LocalizerConfig& config = options.config;
  localization::ReceiverModel& receiver = config.receiver;
  receiver.latency_s = line.Number("latency-s", receiver.latency_s, 0, 2);
  receiver.latency_sigma_s = line.Number("latency-sigma-s", receiver.latency_sigma_s, 0, 1);
  receiver.shared_sigma_m = line.Number("shared-sigma-m", 0.4, 0, 100);
  config.window_s = line.Number("window-s", config.window_s, 2, 300);
  return options;
}

/// A drop-out that takes no fix away would change nothing.
void CheckLocalizationDropout(const datasets::PositionDrive& drive,
                              const evaluation::LocalizationTrial& trial) {
  if (trial.dropout_s <= 0) return;
  const auto after_s = [&drive](const datasets::RecordedFix& fix) {
    return Seconds(fix.stamp_ns - drive.fixes.front().stamp_ns);
  };
  const double end_s = trial.dropout_start_s + trial.dropout_s;
  const bool takes_one =
      std::any_of(drive.fixes.begin(), drive.fixes.end(), [&](const datasets::RecordedFix& fix) {
        return after_s(fix) >= trial.dropout_start_s && after_s(fix) < end_s;
      });
  if (takes_one) return;
  std::ostringstream sentence;
  sentence << "--dropout-s is '" << trial.dropout_start_s << "," << trial.dropout_s
           << "', in which the drive has no fix: its last one comes " << after_s(drive.fixes.back())
           << " s after the first";
  throw Error(sentence.str());
}

int EvaluateLocalizationFiles(int argc, char** argv) {
  const std::optional<Options> options = ParseEvaluateLocalizationOptions(argc, argv);
  if (!options) return 0;
  const datasets::PositionDrive drive = datasets::ReadComma2k19(options->folder);
  CheckLocalizationDropout(drive, options->trial);
  const evaluation::LocalizationReport report =
      evaluation::EvaluateLocalization(drive, options->config, options->trial);
  SayNotes("livemap_evaluate_localization", evaluation::NotesOf(report));
  std::cout << (options->json ? evaluation::ToJson(report).dump() + "\n"
                              : evaluation::ToText(report));
  const std::optional<std::string> why = evaluation::WhyNothingMeasured(report);
  if (!why) return 0;
  SayNothingMeasured("livemap_evaluate_localization", *why);
  return 1;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_evaluate_localization", argc, argv,
                                    livemap::tools::EvaluateLocalizationFiles);
}
