// livemap_evaluate_change: how well a method sees what changed, on pairs with the truth.

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "change/measures/change_pairs.h"
#include "change/measures/change_predictions.h"
#include "change/measures/change_report.h"
#include "change/methods/change_method.h"
#include "change/methods/change_network.h"
#include "change/registration/change_region.h"
#include "change/registration/edge_registration.h"
#include "change/registration/registration.h"
#include "common/error.h"
#include "common/median.h"
#include "tools/common/command_line.h"
#include "tools/common/progress.h"
#include "tools/common/shipped_model.h"

namespace livemap::tools {
namespace {

constexpr std::size_t kCurvePoints = 400;

struct Options {
  std::vector<std::string> directories;
  std::string method;
  std::string model;  ///< Path of a manifest; empty: the method.
  std::string predictions;
  std::string reversed_predictions;
  std::string write;
  std::uint64_t seed = 1;
  std::string registration;  ///< "none", "given", "edges", "homography" or "both".
  std::string region;        ///< Of change::ChangeRegionNames.
  double min_changed = 0;    ///< Share of the pixels that count; pairs below are left out.
  bool json = false;
  bool curves = false;
};

/// Where results go: not among the pictures that they are about.
void CheckChangeOutput(const std::string& folder, const std::vector<std::string>& data) {
  std::error_code unknown;
  if (std::filesystem::exists(folder, unknown) && !std::filesystem::is_directory(folder, unknown)) {
    throw Error("--write is '" + folder + "', which is no folder");
  }
  const std::string target = std::filesystem::weakly_canonical(folder, unknown).string() + "/";
  for (const std::string& each : data) {
    const std::string source = std::filesystem::weakly_canonical(each, unknown).string() + "/";
    if (target.compare(0, source.size(), source) == 0) {
      throw Error("--write is '" + folder + "', which lies in the data of '" + each + "'");
    }
  }
}

/// None when --help was asked for and printed.
std::optional<Options> ParseEvaluateChangeOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_change [FLAGS] DIR...",
      "Compares what a method says about pairs of pictures with the truth. DIR has VL-CMU-CD's\n"
      "layout (raw/NNN/RGB, raw/NNN/GT, as livemap simulate --change writes it), t0/, t1/, "
      "mask/,\nor NAME/t0.jpg, t1.jpg, mask.png, with ignore.png and H_t1_to_t0.txt where there "
      "are "
      "such.\n"
      "The method is a network (--model), a classical one (--method), or a folder of predictions\n"
      "(--predictions: NAME.npy or NAME.png per pair). docs/reference/measures.md defines the "
      "figures and the files.",
      CommandLine::kOneOrMore,
      {{"json", "", "one line of JSON instead of a table"},
       {"method", "NAME", "difference, dense-sift or daisy"},
       {"model", "FILE", "manifest of a network of change (models/change-small.yaml)"},
       {"predictions", "DIR", "read predictions instead of running a method"},
       {"reversed-predictions", "DIR", "the same for the pairs with their pictures swapped"},
       {"register", "HOW",
        "of the earlier picture: none, given (the pair's own homography), edges, homography, or "
        "both: edges first, as on board (both)"},
       {"region", "NAME", "of the pictures: all, or road: below the horizon, a trapezoid (all)"},
       {"seed", "N", "of the registration's draws (1)"},
       {"least-changed", "SHARE", "leave out pairs of which a smaller share has changed (0)"},
       {"curves", "", "with --json: curves, figures per pair, refusals"},
       {"write", "DIR",
        "the method's scores (NAME.png), classes (NAME_class.png), whose: scores.json"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  line.CheckNeeds({{"curves", line.Has("json"), "--json"},
                   {"reversed-predictions", line.Has("predictions"), "--predictions"},
                   {"method", !line.Has("predictions"), "to go without --predictions"},
                   {"model", !line.Has("predictions"), "to go without --predictions"},
                   {"model", !line.Has("method"), "to go without --method"},
                   {"register", !line.Has("predictions"), "to go without --predictions"}});
  Options options;
  options.directories = line.Positionals();
  options.method = line.Text("method", "");
  options.model = line.Text("model", "");
  options.predictions = line.Text("predictions", "");
  options.reversed_predictions = line.Text("reversed-predictions", "");
  options.write = line.Text("write", "");
  if (!options.write.empty()) CheckChangeOutput(options.write, options.directories);
  for (const std::string& folder : {options.predictions, options.reversed_predictions}) {
    std::error_code unknown;
    if (!folder.empty() && !std::filesystem::is_directory(folder, unknown)) {
      throw Error("predictions: '" + folder + "' is not a folder");
    }
  }
  options.seed = line.Seed("seed", 1);
  options.registration = line.Text("register", "both");
  const std::vector<std::string> ways{"none", "given", "edges", "homography", "both"};
  if (std::find(ways.begin(), ways.end(), options.registration) == ways.end()) {
    throw Error("--register is '" + options.registration +
                "', accepted are none, given, edges, homography and both");
  }
  options.region = line.Text("region", "all");
  const std::vector<std::string> regions = change::ChangeRegionNames();
  if (std::find(regions.begin(), regions.end(), options.region) == regions.end()) {
    throw Error("--region is '" + options.region + "', accepted are all and road");
  }
  if (options.method.empty() && options.model.empty() && options.predictions.empty()) {
    options.model = ShippedModel("change-small");
  }
  options.min_changed = line.Number("least-changed", 0, 0, 1);
  options.json = line.Has("json");
  options.curves = line.Has("curves");
  return options;
}

double ChangeMillisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

std::optional<double> MedianChangeTime(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  return TakeMedian(values);
}

/// Of the pixels that the truth does not leave out; 0 where it leaves all out.
double ChangedShare(const cv::Mat& truth) {
  const int known = cv::countNonZero(truth != change::kLeftOutPixel);
  const int unchanged =
      cv::countNonZero(truth == static_cast<int>(protocol::ChangeClass::kNoChange));
  return known == 0 ? 0 : 1 - static_cast<double>(unchanged) / known;
}

class ChangeEvaluation {
 public:
  explicit ChangeEvaluation(const Options& options) : options_(options) {
    report_.registration = options.predictions.empty() ? options.registration : "none";
    report_.method = options.predictions;
    report_.region = options.region;
    report_.has_reversed = !options.reversed_predictions.empty();
    if (!options.predictions.empty()) return;
    report_.compared.emplace();
    report_.unseen.emplace();
    if (options.model.empty()) {
      method_ = change::MakeChangeMethod(options.method);
      report_.method = options.method;
    } else {
      auto network = change::MakeChangeNetwork(options.model);
      report_.method = network->manifest().name;
      regions_.min_confidence = network->manifest().changed;
      report_.on_board_threshold = network->manifest().changed;
      method_ = std::move(network);
    }
    report_.has_reversed = true;
  }

  void Add(const change::ChangePairFiles& files) {
    change::ChangePair pair = change::LoadChangePair(files);
    pair.truth.setTo(int{change::kLeftOutPixel},
                     change::ChangeRegionMask(options_.region, pair.truth.size()) == 0);
    if (ChangedShare(pair.truth) < options_.min_changed) {
      ++report_.hardly_changed;
      return;
    }
    report_.unknown_colour_pixels += pair.unknown_colour_pixels;
    const change::ChangeProbabilities forward = Forward(files, pair);
    Count(files.name, forward, pair, report_.forward);
    if (method_ != nullptr) CountParts(forward, pair);
    if (registered_ && !pair.direction.empty()) CountRegions(forward, pair);
    if (report_.has_reversed) Count(files.name, Reversed(files, pair), pair, report_.reversed);
    if (options_.write.empty()) return;
    change::WriteScorePicture(options_.write + "/" + files.name + ".png", forward);
    change::WriteClassPicture(options_.write + "/" + files.name + "_class.png",
                              change::MostLikely(forward));
  }

  change::ChangeReport Report() {
    report_.method_ms_p50 = MedianChangeTime(method_ms_);
    report_.registration_ms_p50 = MedianChangeTime(registration_ms_);
    return report_;
  }

 private:
  static void Count(const std::string& name, const change::ChangeProbabilities& probabilities,
                    const change::ChangePair& pair, change::ChangeFigures& figures) {
    figures.pooled.Add(probabilities, pair.truth, pair.with_classes);
    figures.community.Add(name, probabilities, pair.truth);
  }

  /// What was compared apart from what was not: a guess is no comparison.
  void CountParts(const change::ChangeProbabilities& probabilities,
                  const change::ChangePair& pair) {
    cv::Mat compared = pair.truth.clone();
    compared.setTo(int{change::kLeftOutPixel}, aligned_.valid == 0);
    report_.compared->Add(probabilities, compared, pair.with_classes);
    cv::Mat unseen = pair.truth.clone();
    unseen.setTo(int{change::kLeftOutPixel}, aligned_.valid != 0);
    report_.unseen->Add(probabilities, unseen, pair.with_classes);
  }

  void CountRegions(const change::ChangeProbabilities& measured, const change::ChangePair& pair) {
    const cv::Mat before = change::FillUnknown(aligned_.before, aligned_.after, aligned_.valid);
    change::ChangeProbabilities probabilities;
    for (const cv::Mat& of_class : measured.of_class) {
      probabilities.of_class.push_back(of_class.clone());
    }
    change::MaskUnobserved(aligned_.valid, probabilities);
    if (!report_.directions) report_.directions.emplace();
    change::CountDirections(
        change::FindChangeRegions(probabilities, before, aligned_.after, regions_),
        change::ChangedClasses(probabilities, regions_.min_confidence), pair.direction,
        *report_.directions);
  }

  change::ChangeProbabilities Forward(const change::ChangePairFiles& files,
                                      const change::ChangePair& pair) {
    if (method_ == nullptr) {
      return change::ReadPrediction(options_.predictions, files.name, pair.truth.size());
    }
    aligned_ = Align(files, pair);
    const auto start = std::chrono::steady_clock::now();
    change::ChangeProbabilities probabilities = Measured(aligned_);
    if (registered_) method_ms_.push_back(ChangeMillisecondsSince(start));
    return probabilities;
  }

  /// After Forward of the same pair: the view stays that of the later picture, whose mask the truth
  /// is.
  change::ChangeProbabilities Reversed(const change::ChangePairFiles& files,
                                       const change::ChangePair& pair) {
    if (method_ == nullptr) {
      return change::ReadPrediction(options_.reversed_predictions, files.name, pair.truth.size());
    }
    return Measured({aligned_.after, aligned_.before, aligned_.valid, true});
  }

  /// A network's scores are probabilities, so it can say how little it knows of what was not seen;
  /// a distance can't, and says that nothing has changed.
  change::ChangeProbabilities Measured(const change::AlignedPair& pair) {
    if (!options_.model.empty()) return method_->Estimate(pair);
    return registered_ ? method_->Run(pair)
                       : change::NothingChanged(pair.after.size(), method_->tells_classes());
  }

  /// As on board, or by one of the two ways alone.
  change::Registration Register(const change::ChangePair& pair) const {
    change::Registration by_edges;
    if (options_.registration != "homography") {
      by_edges = change::RegisterByEdges(pair.before, pair.after, change::RegistrationConfig());
      if (by_edges.accepted() || options_.registration == "edges") return by_edges;
    }
    const change::FeaturedView before{pair.before.size(), change::ExtractFeatures(pair.before)};
    const change::FeaturedView after{pair.after.size(), change::ExtractFeatures(pair.after)};
    change::Registration by_features =
        change::RegisterByHomography(before, after, change::RegistrationConfig(), options_.seed);
    if (!by_features.accepted() && !by_edges.why.empty()) {
      by_features.why = by_edges.why + "; " + by_features.why;
    }
    return by_features;
  }

  /// Of a refused pair nothing earlier is known.
  change::AlignedPair Align(const change::ChangePairFiles& files, const change::ChangePair& pair) {
    registered_ = true;
    if (options_.registration == "none") {
      return {pair.before, pair.after, cv::Mat(pair.after.size(), CV_8UC1, cv::Scalar(255))};
    }
    if (options_.registration == "given") {
      if (!pair.after_from_before) {
        throw Error("--register given: the pair '" + files.name + "' has no H_t1_to_t0.txt");
      }
      const change::WarpedPicture given =
          change::WarpByHomography(pair.before, *pair.after_from_before);
      return {given.picture, pair.after, given.valid};
    }
    const auto start = std::chrono::steady_clock::now();
    const change::Registration registration = Register(pair);
    if (!registration.accepted()) {
      ++report_.refused;
      report_.refusals.push_back(files.name + ": " + registration.why);
      registered_ = false;
      return {pair.after, pair.after, cv::Mat(pair.after.size(), CV_8UC1, cv::Scalar(0))};
    }
    const change::WarpedPicture warped =
        change::WarpByHomography(pair.before, registration.after_from_before);
    registration_ms_.push_back(ChangeMillisecondsSince(start));
    return {warped.picture, pair.after, warped.valid};
  }

  const Options& options_;
  std::unique_ptr<change::ChangeMethod> method_;
  change::ChangeRegionConfig regions_;
  change::AlignedPair aligned_;  ///< Of the pair that was added last.
  bool registered_ = false;      ///< It was not refused.
  std::vector<double> method_ms_;
  std::vector<double> registration_ms_;
  change::ChangeReport report_;
};

/// Whose scores lie in the folder, so that nobody draws them as another method's.
void WriteOriginOfChange(const std::string& folder, const std::string& method,
                         const std::vector<std::string>& directories) {
  const std::string path = folder + "/scores.json";
  std::ofstream file(path);
  file << nlohmann::json{{"method", method}, {"directories", directories}}.dump() << "\n";
  if (!file.flush()) throw Error("file '" + path + "' cannot be written");
}

int EvaluateChange(int argc, char** argv) {
  const std::optional<Options> options = ParseEvaluateChangeOptions(argc, argv);
  if (!options) return 0;
  const std::vector<change::ChangePairFiles> pairs = change::FindChangePairs(options->directories);
  ChangeEvaluation evaluation(*options);
  Progress progress("comparing", pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    evaluation.Add(pairs[i]);
    progress.At(i + 1);
  }
  change::ChangeReport report = evaluation.Report();
  for (const std::string& directory : options->directories) {
    report.directories.push_back(std::filesystem::canonical(directory).string());
  }
  if (report.forward.community.pairs().empty()) {
    throw Error("none of " + std::to_string(pairs.size()) + " pairs has changed by the share of " +
                std::to_string(options->min_changed) + " that --least-changed accepts");
  }
  if (!options->write.empty())
    WriteOriginOfChange(options->write, report.method, report.directories);
  std::cout << (options->json
                    ? change::ToJson(report, options->curves ? kCurvePoints : 0).dump() + "\n"
                    : change::ToText(report));
  const std::optional<std::string> why = change::WhyNothingMeasured(report);
  if (!why) return 0;
  SayNothingMeasured("livemap_evaluate_change", *why);
  return 1;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_evaluate_change", argc, argv,
                                    livemap::tools::EvaluateChange);
}
