// livemap_evaluate_detection: how well a model detects, on labelled folders and drives.

#include <getopt.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <map>
#include <sstream>

#include "base/error.h"
#include "detection/hazard_detector.h"
#include "evaluation/detection_report.h"
#include "evaluation/labelled_folder.h"
#include "ingest/decode.h"
#include "tools/detection_tool_support.h"

namespace livemap {
namespace {

constexpr char kUsage[] = R"(usage: livemap_evaluate_detection [OPTIONS] DIR...

Runs the detector over labelled images and prints how well it does, all DIRs pooled. A DIR holds images/
and labels/ (YOLO: "class x y width height" per line, fractions); with a frames.csv (frame,chainage_m)
it is a drive, which also gives events and false reports per km. docs/evaluation.md defines the figures.

  --json                 one line of JSON instead of a table
  --model FILE           manifest of the model (default: models/hazards-first.yaml of this package)
  --split NAME           part of a DIR whose images/ and labels/ are divided, e.g. val
  --label-classes A,B    names of the label files' classes 0, 1, ... (default: classes.txt in the DIR,
                         else from the DIR's name or, in a drive, the column "potholes")
  --sweep                figures at thresholds from 0.05 to 0.95 too
  --lowest-score X       least score that the average precision counts, default 0.01
  --threads N            threads of OpenCV, default all cores
  --help                 this text
)";

struct Options {
  std::vector<std::string> folders;
  std::string model;
  bool json = false;
  bool sweep = false;
  double lowest_score = 0.01;
  int threads = 0;
  LabelledFolderOptions labels;
};

/// None when --help was asked for and printed.
std::optional<Options> ParseOptions(int argc, char** argv) {
  enum : int { kJson = 1, kModel, kSplit, kClasses, kSweep, kLowest, kThreads, kHelp };
  const option flags[] = {{"json", no_argument, nullptr, kJson},
                          {"model", required_argument, nullptr, kModel},
                          {"split", required_argument, nullptr, kSplit},
                          {"label-classes", required_argument, nullptr, kClasses},
                          {"sweep", no_argument, nullptr, kSweep},
                          {"lowest-score", required_argument, nullptr, kLowest},
                          {"threads", required_argument, nullptr, kThreads},
                          {"help", no_argument, nullptr, kHelp},
                          {nullptr, 0, nullptr, 0}};
  Options options;
  opterr = 0;
  for (int flag = 0; (flag = getopt_long(argc, argv, "", flags, nullptr)) != -1;) {
    switch (flag) {
      case kJson:
        options.json = true;
        break;
      case kModel:
        options.model = optarg;
        break;
      case kSplit:
        options.labels.split = optarg;
        break;
      case kClasses:
        options.labels.label_classes = SplitNames("--label-classes", optarg);
        break;
      case kSweep:
        options.sweep = true;
        break;
      case kLowest:
        options.lowest_score = ParseFlagNumber("--lowest-score", optarg, 0.001, 0.999);
        break;
      case kThreads:
        options.threads = static_cast<int>(ParseFlagNumber("--threads", optarg, 1, 256));
        break;
      case kHelp:
        std::cout << kUsage;
        return std::nullopt;
      default:
        throw Error(std::string("unknown option or missing value at '") + argv[optind - 1] +
                    "', see --help");
    }
  }
  options.folders.assign(argv + optind, argv + argc);
  if (options.folders.empty()) throw Error("no folder given, accepted is DIR..., see --help");
  if (options.model.empty()) options.model = DefaultModelPath();
  return options;
}

/// One line that is rewritten on a terminal; plain lines at every tenth otherwise.
class Progress {
 public:
  explicit Progress(std::size_t total) : total_(total), terminal_(isatty(STDERR_FILENO) == 1) {}

  void Advance() {
    ++done_;
    const std::size_t tenth = 10 * done_ / total_;
    if (terminal_) {
      std::fprintf(stderr, "\rdetecting %zu/%zu%s", done_, total_, done_ == total_ ? "\n" : "");
    } else if (tenth != last_tenth_) {
      std::fprintf(stderr, "detecting %zu/%zu\n", done_, total_);
    }
    last_tenth_ = tenth;
  }

 private:
  std::size_t total_;
  bool terminal_;
  std::size_t done_ = 0;
  std::size_t last_tenth_ = 0;
};

/// Frames of one class: what EvaluateClass wants.
struct ClassFrames {
  std::vector<ScoredDrive> drives;
  std::vector<ScoredFrame> photos;
};

/// Runs the detector over everything and sorts labels and detections by class.
class Evaluation {
 public:
  Evaluation(const ModelManifest& manifest, const Options& options)
      : options_(options), thresholds_(manifest.thresholds) {
    ModelManifest everything = manifest;
    for (float& threshold : everything.thresholds) {
      threshold = std::min(threshold, static_cast<float>(options.lowest_score));
    }
    detector_ = std::make_unique<HazardDetector>(everything, options.threads);
  }

  void Run(const std::vector<LabelledFolder>& folders) {
    std::size_t total = 0;
    for (const LabelledFolder& folder : folders) total += folder.frames.size();
    Progress progress(total);
    for (const LabelledFolder& folder : folders) RunFolder(folder, progress);
  }

  DetectionReport Report() const {
    DetectionReport report;
    report.model = detector_->manifest().name;
    report.frames = milliseconds_.size();
    report.inference_ms_p50 = Quantile(milliseconds_, 0.5);
    report.inference_ms_p95 = Quantile(milliseconds_, 0.95);
    const std::vector<std::string>& classes = detector_->manifest().classes;
    for (std::size_t i = 0; i < classes.size(); ++i) {
      const auto frames = by_class_.find(classes[i]);
      if (frames == by_class_.end()) continue;
      const auto& [drives, photos] = frames->second;
      // Through the float that the detector compares with, so that its boundary cases count alike.
      ClassReport entry{classes[i], EvaluateClass(drives, photos, double{thresholds_[i]}), {}};
      if (options_.sweep) {
        std::vector<double> thresholds;
        for (int step = 1; step < 20; ++step) thresholds.push_back(0.05 * step);
        entry.sweep = SweepThresholds(drives, photos, thresholds);
      }
      report.classes.push_back(std::move(entry));
    }
    return report;
  }

 private:
  void RunFolder(const LabelledFolder& folder, Progress& progress) {
    std::map<std::string, std::vector<ScoredFrame>> scored;
    for (const LabelledFrame& frame : folder.frames) {
      const cv::Mat image = ReadImage(frame.image_path);
      const auto start = std::chrono::steady_clock::now();
      const std::vector<HazardDetection> found = detector_->Detect(image);
      milliseconds_.push_back(
          std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
              .count());
      // A class that is not labelled here says nothing about detections of it.
      for (const std::string& name : folder.classes) {
        scored[name].push_back(Score(frame, found, image.size(), name));
      }
      progress.Advance();
    }
    for (auto& [name, frames] : scored) {
      ClassFrames& all = by_class_[name];
      if (folder.is_drive) {
        all.drives.push_back(std::move(frames));
      } else {
        all.photos.insert(all.photos.end(), frames.begin(), frames.end());
      }
    }
  }

  static ScoredFrame Score(const LabelledFrame& frame, const std::vector<HazardDetection>& found,
                           cv::Size size, const std::string& class_name) {
    ScoredFrame scored;
    scored.chainage_m = frame.chainage_m;
    for (const LabelledFrame::Label& label : frame.labels) {
      if (label.class_name != class_name) continue;
      scored.labels.emplace_back(label.box.x * size.width, label.box.y * size.height,
                                 label.box.width * size.width, label.box.height * size.height);
    }
    for (const HazardDetection& detection : found) {
      if (detection.class_name == class_name) {
        scored.detections.push_back({detection.box, detection.confidence});
      }
    }
    return scored;
  }

  const Options& options_;
  std::vector<float> thresholds_;
  std::unique_ptr<HazardDetector> detector_;
  std::map<std::string, ClassFrames> by_class_;
  std::vector<double> milliseconds_;
};

/// All folders, read before the long work, so that a mistake in the last one shows at once.
std::vector<LabelledFolder> ReadFolders(const Options& options, const ModelManifest& manifest) {
  LabelledFolderOptions reading = options.labels;
  reading.model_classes = manifest.classes;
  std::vector<LabelledFolder> folders;
  for (const std::string& path : options.folders) {
    std::optional<std::string> deduced;
    folders.push_back(ReadLabelledFolder(path, reading, &deduced));
    if (deduced) std::cerr << *deduced << "\n";
    const std::vector<std::string>& classes = folders.back().classes;
    const bool known = std::any_of(classes.begin(), classes.end(), [&](const std::string& name) {
      return std::count(manifest.classes.begin(), manifest.classes.end(), name) != 0;
    });
    if (!known) {
      throw Error("folder '" + path + "' labels '" + classes[0] + "', the model '" + manifest.name +
                  "' accepts " + JoinNames(manifest.classes));
    }
  }
  return folders;
}

int Run(int argc, char** argv) {
  const std::optional<Options> options = ParseOptions(argc, argv);
  if (!options) return 0;
  const ModelManifest manifest = ReadModelManifest(options->model);
  const std::vector<LabelledFolder> folders = ReadFolders(*options, manifest);
  Evaluation evaluation(manifest, *options);
  evaluation.Run(folders);
  const DetectionReport report = evaluation.Report();
  std::cout << (options->json ? ToJson(report).dump() + "\n" : ToText(report));
  return 0;
}

}  // namespace
}  // namespace livemap

int main(int argc, char** argv) {
  return livemap::RunTool("livemap_evaluate_detection", [&] { return livemap::Run(argc, argv); });
}
