// livemap_evaluate_privacy: what the privacy mask finds in photos, and what it costs.

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CompressedImage.h>

#include <chrono>
#include <ctime>
#include <filesystem>
#include <functional>
#include <iostream>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "common/error.h"
#include "common/median.h"
#include "imaging/report_picture.h"
#include "perception/detection/hazard_detector.h"
#include "perception/privacy/privacy_mask.h"
#include "tools/common/command_line.h"
#include "tools/common/output_path.h"
#include "tools/common/shipped_model.h"
#include "tools/detection/detection_tool_support.h"
#include "tools/detection/privacy_labels.h"

namespace livemap::tools {
namespace {

struct Options {
  std::vector<std::string> images;
  std::string model;
  std::string output;
  bool hazards = false;
  std::optional<PrivacyLabels> labels;
  perception::PrivacyMask::Config mask;
  int threads = 0;
};

bool IsBag(const std::string& path) { return std::filesystem::path(path).extension() == ".bag"; }

perception::PrivateRegionSource ParseFinder(const std::string& text) {
  if (text == "auto") return perception::PrivateRegionSource::kAuto;
  if (text == "networks") return perception::PrivateRegionSource::kNetworks;
  if (text == "cascades") return perception::PrivateRegionSource::kCascades;
  throw Error("--finder is '" + text + "', accepted are auto, networks, cascades");
}

/// None when --help was asked for and printed.
std::optional<Options> ParseEvaluatePrivacyOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_privacy [FLAGS] IMAGE|BAG...",
      "Masks faces and number plates in photos as hazard_reporting does before a picture leaves "
      "the\n"
      "car, each photo by itself; of a bag its compressed images. Prints a line per photo with "
      "masks\n"
      "(number and their rectangles, x y width height), then counts, and the time in relation to "
      "the\n"
      "detector's on the same photos. With --hazards also the pictures that reports of the "
      "detector's\n"
      "finds would show: how many hazards a mask would cover, and how many one covers because it "
      "is sure.\n"
      "With --labels also how many labelled faces and plates the masks cover by three quarters or "
      "more,\n"
      "and how many masks touch no label.",
      CommandLine::kOneOrMore,
      {{"model", "FILE", "manifest of the detector, default models/hazards-base.yaml"},
       {"finder", "auto|networks|cascades",
        "what looks for them, default auto: networks where they are placed"},
       {"networks", "FILE", "manifest of the networks, default models/privacy.yaml"},
       {"cascades", "FOLDER", "OpenCV's cascades, default those of Debian's opencv-data"},
       {"face-model", "FILE", "a YuNet model that looks for the faces instead"},
       {"min-side", "PIXELS", "smaller ones are not looked for by the cascades, default 16"},
       {"labels", "FILE", "lines of PHOTO face|plate|unclear X Y WIDTH HEIGHT"},
       {"hazards", "", "mask each detected hazard's picture by itself"},
       {"output", "FOLDER",
        "write the masked photos there, or with --hazards the hazards' pictures"},
       {"threads", "N", "threads of OpenCV, default all cores"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  Options options;
  options.images = line.Positionals();
  options.model = line.Text("model", ShippedModel(kDefaultDetector));
  options.output = line.Text("output", "");
  std::vector<std::string> photos;  // Those in a bag have no file that could be overwritten.
  std::copy_if(options.images.begin(), options.images.end(), std::back_inserter(photos),
               [](const std::string& path) { return !IsBag(path); });
  if (!options.output.empty()) CheckOutputFolder("--output", options.output, photos);
  options.hazards = line.Has("hazards");
  perception::PrivateRegionConfig& regions = options.mask.regions;
  regions.source = ParseFinder(line.Text("finder", "auto"));
  regions.networks = line.Text("networks", ShippedModel("privacy"));
  if (line.Has("labels")) options.labels = PrivacyLabels::Load(line.Text("labels", ""));
  regions.cascades = line.Text("cascades", regions.cascades);
  regions.face_model = line.Text("face-model", regions.face_model);
  regions.min_side_px = line.Whole("min-side", regions.min_side_px, 8, 1000);
  options.threads = line.Whole("threads", 0, 0, 256);
  return options;
}

double MedianPrivacyTime(std::vector<double> values) {
  if (values.empty()) return 0;
  return TakeMedian(values);
}

/// How long `work` takes, ms.
template <typename Work>
double MaskingMilliseconds(const Work& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

/// The same in processor time of all threads, which a busy machine does not change much.
template <typename Work>
double MaskingProcessorMilliseconds(const Work& work) {
  const auto now_ms = [] {
    std::timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
  };
  const double begin = now_ms();
  work();
  return now_ms() - begin;
}

std::filesystem::path OutputOf(const Options& options, const std::string& name,
                               const std::string& suffix) {
  return std::filesystem::path(options.output) /
         (std::filesystem::path(name).stem().string() + suffix + ".jpg");
}

/// `name` is the photo's path; of a bag the bag's without extension, with the image's number.
using OnPhoto = std::function<void(const std::string& name, cv::Mat image)>;

void ForEachImageOfBag(const std::string& path, const OnPhoto& on_photo) {
  rosbag::Bag bag;
  try {
    bag.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagException& error) {
    throw Error("bag '" + path + "' cannot be read: " + error.what());
  }
  std::size_t number = 0;
  for (const rosbag::MessageInstance& each :
       rosbag::View(bag, rosbag::TypeQuery("sensor_msgs/CompressedImage"))) {
    const auto image = each.instantiate<sensor_msgs::CompressedImage>();
    const std::string name =
        std::filesystem::path(path).replace_extension().string() + "_" + std::to_string(number++);
    on_photo(name, DecodePhoto(image->data.data(), image->data.size(), name));
  }
  if (number == 0) {
    throw Error("bag '" + path + "' has no image, accepted are sensor_msgs/CompressedImage");
  }
}

void ForEachPhoto(const Options& options, const OnPhoto& on_photo) {
  for (const std::string& path : options.images) {
    if (IsBag(path)) {
      ForEachImageOfBag(path, on_photo);
    } else {
      on_photo(path, ReadImage(path));
    }
  }
}

/// A find hides a hazard when it lies over this share of its box.
constexpr double kCoveredShare = 0.1;

bool IsCovered(const cv::Rect& box, const std::vector<cv::Rect>& masks) {
  return CoveredShare(box, masks) >= kCoveredShare;
}

class Measurement {
 public:
  explicit Measurement(const Options& options)
      : options_(options),
        detector_(perception::ReadModelManifest(options.model), options.threads),
        mask_(options.mask) {}

  /// Masks what it finds in the photo itself.
  void Measure(const std::string& name, const cv::Mat& photo) {
    cv::Mat image = photo;
    std::vector<perception::HazardDetection> hazards;
    detection_ms_.push_back(MaskingMilliseconds([&] { hazards = detector_.Detect(image); }));
    if (options_.hazards) {
      for (const perception::HazardDetection& hazard : hazards) MeasureHazard(name, image, hazard);
    }
    mask_cpu_ms_.push_back(MaskingProcessorMilliseconds([&] {
      mask_ms_.push_back(MaskingMilliseconds([&] { mask_.Apply(image, NextFrame()); }));
    }));
    ratios_.push_back(mask_ms_.back() / detection_ms_.back());
    const std::vector<cv::Rect> masked = mask_.Masked();
    if (options_.labels) score_.Add(options_.labels->Of(name), masked, mask_.SurelyMasked());
    if (!masked.empty()) {
      ++with_masks_;
      masks_ += masked.size();
      sure_masks_ += mask_.SurelyMasked().size();
      std::cout << name << " " << masked.size();
      for (const cv::Rect& box : masked) {
        std::cout << "  " << box.x << " " << box.y << " " << box.width << " " << box.height;
      }
      std::cout << "\n";
    }
    if (!options_.hazards) WriteMasked(name, "", image);
  }

  void Print() const {
    std::cout << mask_ms_.size() << " photos, " << with_masks_ << " with masks, " << masks_
              << " masks\nmask " << MedianPrivacyTime(mask_ms_) << " ms per photo, detection "
              << MedianPrivacyTime(detection_ms_) << " ms, ratio " << MedianPrivacyTime(ratios_)
              << " (medians)\n"
              << sure_masks_ << " masks are sure\n"
              << mask_.FinderName() << " looked for faces and plates, "
              << MedianPrivacyTime(mask_cpu_ms_) << " ms of processor time per photo (median)\n";
    if (options_.labels) {
      std::cout << score_.faces_masked << " of " << score_.faces << " labelled faces and "
                << score_.plates_masked << " of " << score_.plates
                << " labelled plates are masked, " << score_.false_masks
                << " masks touch no label, " << score_.false_sure_masks << " of them sure\n";
    }
    if (options_.hazards) {
      std::cout << hazards_ << " hazards, " << covered_by_any_
                << " that a find would cover by a tenth or more, " << covered_
                << " covered because it is sure\n";
    }
  }

  std::size_t hazards() const { return hazards_; }

 private:
  /// A photo masked as a whole, or the picture of one hazard: never both in one run.
  void WriteMasked(const std::string& name, const std::string& suffix, const cv::Mat& masked) {
    if (options_.output.empty()) return;
    const std::string path = OutputOf(options_, name, suffix).string();
    if (!written_.insert(path).second) {
      throw Error("'" + path + "' would be written twice, accepted are photos of different names");
    }
    if (!cv::imwrite(path, masked)) throw Error("cannot write '" + path + "'");
  }

  /// Far apart, so that no mask is kept from one picture to the next.
  std::uint64_t NextFrame() { return frame_ += 1000; }

  /// As a report's picture is masked: the widest crop around the box alone is clear.
  void MeasureHazard(const std::string& name, const cv::Mat& image,
                     const perception::HazardDetection& hazard) {
    const cv::Rect box = cv::Rect(hazard.box) & cv::Rect({}, image.size());
    if (box.empty()) return;
    const imaging::PixelRegion shown =
        imaging::WidestCrop({hazard.box.x, hazard.box.y, hazard.box.br().x, hazard.box.br().y},
                            image.cols, image.rows, imaging::CropConfig());
    const cv::Rect part =
        shown.IsWholeImage()
            ? cv::Rect({}, image.size())
            : cv::Rect(static_cast<int>(shown.x), static_cast<int>(shown.y),
                       static_cast<int>(shown.width), static_cast<int>(shown.height));
    cv::Mat picture = image.clone();
    mask_.Apply(picture, NextFrame(), part, {box});
    ++hazards_;
    if (IsCovered(box, mask_.Masked())) ++covered_by_any_;
    if (IsCovered(box, mask_.SurelyMasked())) {
      ++covered_;
      std::cout << name << " " << hazard.class_name << " at " << box.x << " " << box.y << " "
                << box.width << " " << box.height << " is covered\n";
    }
    WriteMasked(name, "_" + std::to_string(hazards_), picture(part));
  }

  const Options& options_;
  std::set<std::string> written_;
  perception::HazardDetector detector_;
  perception::PrivacyMask mask_;
  PrivacyScore score_;
  std::vector<double> mask_ms_, mask_cpu_ms_, detection_ms_, ratios_;
  std::size_t with_masks_ = 0, masks_ = 0, sure_masks_ = 0;
  std::size_t hazards_ = 0, covered_by_any_ = 0, covered_ = 0;
  std::uint64_t frame_ = 0;
};

int EvaluatePrivacy(int argc, char** argv) {
  const std::optional<Options> options = ParseEvaluatePrivacyOptions(argc, argv);
  if (!options) return 0;
  Measurement measurement(*options);
  ForEachPhoto(*options, [&](const std::string& name, const cv::Mat& image) {
    measurement.Measure(name, image);
  });
  measurement.Print();
  if (options->hazards && measurement.hazards() == 0) {
    std::cerr << "livemap_evaluate_privacy: the detector found no hazard in the photos, so none "
                 "was measured\n";
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_evaluate_privacy", argc, argv,
                                    livemap::tools::EvaluatePrivacy);
}
