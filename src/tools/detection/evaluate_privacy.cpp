// livemap_evaluate_privacy: what the privacy mask finds in photos, and what it costs.

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <vector>

#include "common/error.h"
#include "perception/detection/hazard_detector.h"
#include "perception/privacy/privacy_mask.h"
#include "tools/common/command_line.h"
#include "tools/common/shipped_model.h"
#include "tools/detection/detection_tool_support.h"

namespace livemap::tools {
namespace {

struct Options {
  std::vector<std::string> images;
  std::string model;
  std::string output;
  perception::PrivacyMask::Config mask;
  int threads = 0;
};

/// None when --help was asked for and printed.
std::optional<Options> ParseOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_evaluate_privacy [FLAGS] IMAGE...",
      "Masks faces and number plates in photos as hazard_detection does before a picture leaves "
      "the\n"
      "car, each photo by itself. Prints a line per photo with masks (number and their "
      "rectangles,\n"
      "x y width height), then counts, and the time in relation to the detector's on the same "
      "photos.",
      CommandLine::kOneOrMore,
      {{"model", "FILE", "manifest of the detector, default models/hazards-base.yaml"},
       {"cascades", "FOLDER", "OpenCV's cascades, default those of Debian's opencv-data"},
       {"face-model", "FILE", "a YuNet model that looks for the faces instead"},
       {"min-side", "PIXELS", "smaller ones are not looked for, default 16"},
       {"output", "FOLDER", "write the masked photos there"},
       {"threads", "N", "threads of OpenCV, default all cores"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  Options options;
  options.images = line.Positionals();
  options.model = line.Text("model", ShippedModel(kDefaultDetector));
  options.output = line.Text("output", "");
  perception::PrivateRegionConfig& regions = options.mask.regions;
  regions.cascades = line.Text("cascades", regions.cascades);
  regions.face_model = line.Text("face-model", regions.face_model);
  regions.min_side_px = line.Whole("min-side", regions.min_side_px, 8, 1000);
  options.threads = line.Whole("threads", 0, 0, 256);
  return options;
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

/// How long `work` takes, ms.
template <typename Work>
double Milliseconds(const Work& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
}

void Write(const Options& options, const std::string& source, const cv::Mat& masked) {
  if (options.output.empty()) return;
  const auto path = std::filesystem::path(options.output) /
                    std::filesystem::path(source).filename().replace_extension(".jpg");
  if (!cv::imwrite(path.string(), masked)) throw Error("cannot write '" + path.string() + "'");
}

int Run(int argc, char** argv) {
  const std::optional<Options> options = ParseOptions(argc, argv);
  if (!options) return 0;
  perception::HazardDetector detector(perception::ReadModelManifest(options->model),
                                      options->threads);
  perception::PrivacyMask mask(options->mask);
  std::vector<double> mask_ms, detection_ms, ratios;
  std::size_t with_masks = 0, masks = 0;
  // Far apart, so that no mask is kept from one photo to the next.
  std::uint64_t frame = 0;
  for (const std::string& path : options->images) {
    cv::Mat image = ReadImage(path);
    detection_ms.push_back(Milliseconds([&] { detector.Detect(image); }));
    frame += 1000;
    mask_ms.push_back(Milliseconds([&] { mask.Apply(image, frame); }));
    ratios.push_back(mask_ms.back() / detection_ms.back());
    const std::vector<cv::Rect> masked = mask.Masked();
    if (!masked.empty()) {
      ++with_masks;
      masks += masked.size();
      std::cout << path << " " << masked.size();
      for (const cv::Rect& box : masked) {
        std::cout << "  " << box.x << " " << box.y << " " << box.width << " " << box.height;
      }
      std::cout << "\n";
    }
    Write(*options, path, image);
  }
  std::cout << options->images.size() << " photos, " << with_masks << " with masks, " << masks
            << " masks\nmask " << Median(mask_ms) << " ms per photo, detection "
            << Median(detection_ms) << " ms, ratio " << Median(ratios) << " (medians)\n";
  return 0;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_evaluate_privacy", argc, argv, livemap::tools::Run);
}
