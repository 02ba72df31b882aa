// livemap_evaluate_detection: how well a model detects, on labelled folders and drives.

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <system_error>

#include "common/error.h"
#include "evaluation/detection/detection_report.h"
#include "evaluation/detection/detection_table.h"
#include "evaluation/detection/labelled_folder.h"
#include "evaluation/detection/tracking_evaluation.h"
#include "evaluation/quantile.h"
#include "imaging/decode.h"
#include "perception/detection/hazard_detector.h"
#include "tools/common/command_line.h"
#include "tools/common/progress.h"
#include "tools/common/shipped_model.h"
#include "tools/detection/detection_tool_support.h"
#include "tools/detection/error_sheets.h"

namespace livemap::tools {
namespace {

struct Options {
  std::vector<std::string> folders;
  std::string model;
  std::string detections;
  bool json = false;
  bool sweep = false;
  bool tracking = false;
  std::string errors;
  evaluation::TrackedDriveConfig tracked;
  perception::ObjectTracker::Config tracker;
  double lowest_score = 0.01;
  int threads = 0;
  std::optional<perception::EngineKind> engine;
  evaluation::LabelledFolderConfig labels;
};

/// None when --help was asked for and printed.
std::optional<Options> ParseEvaluateDetectionOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_detection [FLAGS] DIR...",
      "Runs the detector over labelled images and prints how well it does, all DIRs pooled. A DIR\n"
      "holds images/ and labels/ (YOLO: \"class x y width height\" per line, fractions); with a\n"
      "frames.csv (frame,chainage_m) it is a drive, which also gives events and false reports per\n"
      "km. docs/reference/measures.md defines the figures.",
      CommandLine::kOneOrMore,
      {{"json", "", "one line of JSON instead of a table"},
       {"detections", "FILE",
        "measure what this CSV file lists, all of it, instead of what the model\n"
        "finds in the one DIR: image,class,score,x_min,y_min,x_max,y_max (px)"},
       {"model", "FILE", "manifest of the model, default models/hazards-base.yaml, as a vehicle's"},
       {"split", "NAME", "part of a DIR whose images/ and labels/ are divided, e.g. val"},
       {"label-classes", "A,B", "names of the label files' classes 0, 1, ..., default classes.txt"},
       {"sweep", "", "figures at thresholds from 0.05 to 0.95 too"},
       {"errors", "DIR",
        "drives: write contact sheets of missed events and false reports, and\n"
        "a list of them, into this new folder"},
       {"tracking", "", "drives: the tracker's events at several degrees of certainty too"},
       {"camera", "FILE",
        "with --tracking: camera of the drives (config/cameras), default none:\n"
        "boxes are then followed by their motion in the image"},
       {"repeat-gain", "X", "with --tracking: share of repeated sights, default 0.15"},
       {"low-share", "X", "with --tracking: least share of the threshold, default 0.5"},
       {"lowest-score", "X", "least score that the average precision counts, default 0.01"},
       {"engine", "NAME", "auto (what the manifest says, default), opencv or torch"},
       {"threads", "N", "threads of the engine, default all cores"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  Options options;
  options.folders = line.Positionals();
  options.model = line.Text("model", "");
  options.detections = line.Text("detections", "");
  if (options.model.empty()) options.model = ShippedModel(kDefaultDetector);
  options.json = line.Has("json");
  options.sweep = line.Has("sweep");
  options.tracking = line.Has("tracking");
  options.errors = line.Text("errors", "");
  if (!options.errors.empty() && std::filesystem::exists(options.errors)) {
    throw Error("--errors is '" + options.errors + "', which exists, accepted is a new folder");
  }
  line.CheckNeeds({{"camera", options.tracking, "--tracking"},
                   {"repeat-gain", options.tracking, "--tracking"},
                   {"low-share", options.tracking, "--tracking"}});
  if (!options.detections.empty()) {
    if (options.folders.size() != 1) {
      throw Error("--detections is about one DIR, given are " +
                  std::to_string(options.folders.size()));
    }
    for (const char* of_a_run : {"engine", "threads", "lowest-score", "tracking"}) {
      if (line.Has(of_a_run)) {
        throw Error(std::string("--") + of_a_run +
                    " is about a run of the model, with --detections there is none");
      }
    }
  }
  const std::string camera = line.Text("camera", "");
  if (!camera.empty()) options.tracked.camera = datasets::ReadCameraFile(camera);
  options.tracker.repeat_gain = line.Number("repeat-gain", options.tracker.repeat_gain, 0, 1);
  options.tracker.low_share = line.Number("low-share", options.tracker.low_share, 0.01, 1);
  options.lowest_score = line.Number("lowest-score", options.lowest_score, 0.001, 0.999);
  options.engine = perception::ParseEngineChoice(line.Text("engine", "auto"), "--engine");
  options.threads = line.Whole("threads", 0, 1, 256);
  options.labels.split = line.Text("split", "");
  options.labels.label_classes = SplitNames("--label-classes", line.Text("label-classes", ""));
  return options;
}

/// Frames of one class: what EvaluateClass wants.
struct ClassFrames {
  std::vector<evaluation::ScoredDrive> drives;
  std::vector<std::vector<std::string>> pictures;  ///< Paths, of the drives' frames.
  std::vector<evaluation::ScoredFrame> photos;
};

/// Runs the detector over everything, or looks up what the table of --detections lists, and sorts
/// labels and detections by class.
class DetectionEvaluation {
 public:
  DetectionEvaluation(const perception::ModelManifest& manifest, const Options& options)
      : options_(options), classes_(manifest.classes), thresholds_(manifest.thresholds) {
    if (!options.detections.empty()) {
      // Whoever made the table has chosen already: all of it counts.
      std::fill(thresholds_.begin(), thresholds_.end(), 0.0F);
      return;
    }
    perception::ModelManifest everything = manifest;
    for (float& threshold : everything.thresholds) {
      threshold = std::min(threshold, static_cast<float>(options.lowest_score));
    }
    detector_ =
        std::make_unique<perception::HazardDetector>(everything, options.threads, options.engine);
  }

  void Run(const std::vector<evaluation::LabelledFolder>& folders) {
    if (!detector_) ReadTable(folders.front());
    std::size_t total = 0;
    for (const evaluation::LabelledFolder& folder : folders) total += folder.frames.size();
    Progress progress("detecting", total);
    for (const evaluation::LabelledFolder& folder : folders) RunFolder(folder, progress);
  }

  evaluation::DetectionReport Report() const {
    evaluation::DetectionReport report;
    report.model = detector_ ? detector_->manifest().name : options_.detections;
    report.frames = frames_;
    if (!milliseconds_.empty()) {
      report.inference_ms_p50 = evaluation::Quantile(milliseconds_, 0.5);
      report.inference_ms_p95 = evaluation::Quantile(milliseconds_, 0.95);
    }
    for (std::size_t i = 0; i < classes_.size(); ++i) {
      const auto frames = by_class_.find(classes_[i]);
      if (frames == by_class_.end()) continue;
      const auto& [drives, pictures, photos] = frames->second;
      // Through the float that the detector compares with, so that its boundary cases count alike.
      evaluation::ClassReport entry{
          classes_[i], evaluation::EvaluateClass(drives, photos, double{thresholds_[i]}), {}};
      if (options_.sweep) {
        std::vector<double> thresholds;
        for (int step = 1; step < 20; ++step) thresholds.push_back(0.05 * step);
        entry.sweep = evaluation::SweepThresholds(drives, photos, thresholds);
      }
      if (options_.tracking) AddTracking(drives, entry);
      AddCauses(drives, entry);
      if (!options_.errors.empty()) WriteErrors(drives, pictures, entry);
      report.classes.push_back(std::move(entry));
    }
    return report;
  }

 private:
  /// A line about a picture that is not there, or about a class that nobody knows, would silently
  /// not count.
  void ReadTable(const evaluation::LabelledFolder& folder) {
    std::vector<std::string> known = classes_;
    for (const std::string& name : folder.classes) {
      if (std::count(known.begin(), known.end(), name) == 0) known.push_back(name);
    }
    table_ = evaluation::ReadDetectionTable(options_.detections, known);
    std::set<std::string> pictures;
    for (const evaluation::LabelledFrame& frame : folder.frames) {
      pictures.insert(std::filesystem::path(frame.image_path).stem().string());
    }
    for (const auto& [picture, found] : table_) {
      if (pictures.count(picture) == 0) {
        throw Error("'" + options_.detections + "' names the picture '" + picture +
                    "', which is not among those of '" + folder.path + "'");
      }
    }
  }

  /// A box that lies beside the picture is in other units or another picture's.
  void CheckBoxes(const std::string& picture, cv::Size size,
                  const std::vector<perception::HazardDetection>& found) const {
    const cv::Rect2f whole(0, 0, static_cast<float>(size.width), static_cast<float>(size.height));
    for (const perception::HazardDetection& detection : found) {
      const cv::Rect2f& box = detection.box;
      if (!(box & whole).empty()) continue;
      std::ostringstream sentence;
      sentence << "'" << options_.detections << "' has for the picture '" << picture << "' the box "
               << box.x << "," << box.y << "," << box.br().x << "," << box.br().y
               << ", accepted are boxes that overlap its " << size.width << "x" << size.height
               << " px";
      throw Error(sentence.str());
    }
  }

  std::vector<perception::HazardDetection> DetectionsIn(const evaluation::LabelledFrame& frame,
                                                        const cv::Mat& image) {
    if (!detector_) {
      const auto found = table_.find(std::filesystem::path(frame.image_path).stem().string());
      if (found == table_.end()) return {};
      CheckBoxes(frame.image_path, image.size(), found->second);
      return found->second;
    }
    const auto start = std::chrono::steady_clock::now();
    std::vector<perception::HazardDetection> found = detector_->Detect(image);
    milliseconds_.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    return found;
  }

  /// What the tracker reports on the class's drives, at several degrees of certainty.
  void AddTracking(const std::vector<evaluation::ScoredDrive>& drives,
                   evaluation::ClassReport& entry) const {
    const std::vector<std::size_t>& recordings = drive_recordings_.at(entry.class_name);
    for (int step = 5; step <= 30; ++step) {
      perception::ObjectTracker::Config config = options_.tracker;
      config.sure = 0.1 * step;
      std::vector<evaluation::ScoredDrive> events;
      for (std::size_t i = 0; i < drives.size(); ++i) {
        events.push_back(evaluation::EventsOfDrive(drives[i], recordings_[recordings[i]],
                                                   entry.class_name,
                                                   perception::ObjectTracker(config, thresholds_)));
      }
      entry.tracking.push_back(evaluation::SweepThresholds(events, {}, {0.0}).front());
      entry.tracking.back().threshold = config.sure;
    }
  }

  static void AddCauses(const std::vector<evaluation::ScoredDrive>& drives,
                        evaluation::ClassReport& entry) {
    for (const evaluation::ScoredDrive& drive : drives) {
      for (const evaluation::MissedEvent& missed :
           evaluation::FindMissedEvents(drive, entry.figures.threshold)) {
        ++entry.missed_by_cause[evaluation::CauseName(missed.cause)];
      }
      for (const evaluation::FalseReport& report :
           evaluation::FindFalseReports(drive, entry.figures.threshold)) {
        ++entry.false_by_cause[evaluation::CauseName(report.cause)];
      }
    }
  }

  void WriteErrors(const std::vector<evaluation::ScoredDrive>& drives,
                   const std::vector<std::vector<std::string>>& pictures,
                   const evaluation::ClassReport& entry) const {
    std::vector<PicturedDrive> pictured;
    for (std::size_t i = 0; i < drives.size(); ++i) pictured.push_back({&drives[i], &pictures[i]});
    WriteErrorSheets(options_.errors, entry.class_name, pictured, entry.figures.threshold);
  }

  void RunFolder(const evaluation::LabelledFolder& folder, Progress& progress) {
    // Two numbers of the label files may stand for one class, which counts once.
    const std::set<std::string> names(folder.classes.begin(), folder.classes.end());
    std::map<std::string, std::vector<evaluation::ScoredFrame>> scored;
    std::vector<perception::TrackerFrame> recording;
    std::vector<std::string> pictures;
    for (const evaluation::LabelledFrame& frame : folder.frames) {
      const cv::Mat image = ReadImage(frame.image_path);
      pictures.push_back(frame.image_path);
      const std::vector<perception::HazardDetection> found = DetectionsIn(frame, image);
      ++frames_;
      // A class that is not labelled here says nothing about detections of it.
      for (const std::string& name : names) {
        scored[name].push_back(Score(frame, found, image.size(), name));
      }
      if (options_.tracking && folder.is_drive) {
        const std::int64_t last_ns = recording.empty() ? 0 : recording.back().stamp_ns;
        recording.push_back(evaluation::ToTrackerFrame(found, image.size(), frame.chainage_m,
                                                       last_ns, options_.tracked));
      }
      progress.At(frames_);
    }
    for (auto& [name, frames] : scored) {
      ClassFrames& all = by_class_[name];
      if (folder.is_drive) {
        all.drives.push_back(std::move(frames));
        all.pictures.push_back(pictures);
        drive_recordings_[name].push_back(recordings_.size());
      } else {
        all.photos.insert(all.photos.end(), frames.begin(), frames.end());
      }
    }
    recordings_.push_back(std::move(recording));
  }

  static std::vector<cv::Rect2f> BoxesOf(
      const std::vector<evaluation::LabelledFrame::Label>& labels, cv::Size size,
      const std::string& class_name) {
    std::vector<cv::Rect2f> boxes;
    for (const evaluation::LabelledFrame::Label& label : labels) {
      if (label.class_name != class_name) continue;
      boxes.emplace_back(label.box.x * size.width, label.box.y * size.height,
                         label.box.width * size.width, label.box.height * size.height);
    }
    return boxes;
  }

  static evaluation::ScoredFrame Score(const evaluation::LabelledFrame& frame,
                                       const std::vector<perception::HazardDetection>& found,
                                       cv::Size size, const std::string& class_name) {
    evaluation::ScoredFrame scored;
    scored.chainage_m = frame.chainage_m;
    scored.labels = BoxesOf(frame.labels, size, class_name);
    scored.difficult = BoxesOf(frame.difficult, size, class_name);
    for (const perception::HazardDetection& detection : found) {
      if (detection.class_name == class_name) {
        scored.detections.push_back({detection.box, detection.confidence});
      }
    }
    return scored;
  }

  const Options& options_;
  std::vector<std::string> classes_;
  std::vector<float> thresholds_;
  std::unique_ptr<perception::HazardDetector> detector_;  ///< None with --detections.
  evaluation::DetectionTable table_;                      ///< With --detections.
  std::map<std::string, ClassFrames> by_class_;
  std::size_t frames_ = 0;
  std::vector<double> milliseconds_;                               ///< Of the detector's runs.
  std::vector<std::vector<perception::TrackerFrame>> recordings_;  ///< By folder; with --tracking.
  std::map<std::string, std::vector<std::size_t>> drive_recordings_;  ///< By class, as its drives.
};

/// A folder given twice would count double.
void RefuseRepeatedFolders(const std::vector<std::string>& folders) {
  std::set<std::filesystem::path> seen;
  for (const std::string& path : folders) {
    std::error_code unknown;  // A folder that does not exist is the reader's to refuse.
    if (!seen.insert(std::filesystem::weakly_canonical(path, unknown)).second && !unknown) {
      throw Error("folder '" + path + "' is given twice, its figures would count double");
    }
  }
}

/// All folders, read before the long work, so that a mistake in the last one shows at once.
std::vector<evaluation::LabelledFolder> ReadFoldersToEvaluate(
    const Options& options, const perception::ModelManifest& manifest) {
  evaluation::LabelledFolderConfig reading = options.labels;
  reading.model_classes = manifest.classes;
  std::vector<evaluation::LabelledFolder> folders;
  RefuseRepeatedFolders(options.folders);
  for (const std::string& path : options.folders) {
    std::optional<std::string> deduced;
    folders.push_back(evaluation::ReadLabelledFolder(path, reading, &deduced));
    if (deduced) std::cerr << *deduced << "\n";
    SayNotes("livemap_evaluate_detection", folders.back().notes);
    const std::vector<std::string>& classes = folders.back().classes;
    const bool known = std::any_of(classes.begin(), classes.end(), [&](const std::string& name) {
      return std::count(manifest.classes.begin(), manifest.classes.end(), name) != 0;
    });
    if (!known) {
      throw Error("folder '" + path + "' labels '" + classes[0] + "', the model '" + manifest.name +
                  "' accepts " + JoinNames(manifest.classes));
    }
  }
  if (!options.errors.empty() &&
      std::none_of(folders.begin(), folders.end(),
                   [](const evaluation::LabelledFolder& folder) { return folder.is_drive; })) {
    throw Error("--errors needs a drive, a DIR with frames.csv");
  }
  return folders;
}

int EvaluateDetection(int argc, char** argv) {
  const std::optional<Options> options = ParseEvaluateDetectionOptions(argc, argv);
  if (!options) return 0;
  const perception::ModelManifest manifest = perception::ReadModelManifest(options->model);
  const std::vector<evaluation::LabelledFolder> folders = ReadFoldersToEvaluate(*options, manifest);
  DetectionEvaluation evaluation(manifest, *options);
  evaluation.Run(folders);
  const evaluation::DetectionReport report = evaluation.Report();
  if (!options->errors.empty()) std::cerr << "errors: " << options->errors << "/errors.csv\n";
  std::cout << (options->json ? evaluation::ToJson(report).dump() + "\n"
                              : evaluation::ToText(report));
  const std::optional<std::string> why = evaluation::WhyNothingMeasured(report);
  if (!why) return 0;
  SayNothingMeasured("livemap_evaluate_detection", *why);
  return 1;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_evaluate_detection", argc, argv,
                                    livemap::tools::EvaluateDetection);
}
