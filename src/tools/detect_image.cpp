// livemap_detect_image: what a model finds in single images.

#include <getopt.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "base/error.h"
#include "detection/annotation.h"
#include "detection/hazard_detector.h"
#include "tools/detection_tool_support.h"

namespace livemap {
namespace {

constexpr char kUsage[] = R"(usage: livemap_detect_image [OPTIONS] IMAGE...

Prints what the detector finds in each JPEG or PNG image, one line of JSON per image:
{"image":...,"width":w,"height":h,"detections":[{"class":...,"confidence":c,"box":[x1,y1,x2,y2]}]}

  --model FILE     manifest of the model (default: models/hazards-first.yaml of this package)
  --threshold X    least confidence, instead of the manifest's
  --draw FILE      write the image with the detections drawn in (.jpg or .png; one IMAGE only)
  --threads N      threads of OpenCV, default all cores
  --help           this text
)";

struct Options {
  std::vector<std::string> images;
  std::string model;
  std::string draw;
  std::optional<double> threshold;
  int threads = 0;
};

/// None when --help was asked for and printed.
std::optional<Options> ParseOptions(int argc, char** argv) {
  enum : int { kModel = 1, kThreshold, kDraw, kThreads, kHelp };
  const option flags[] = {{"model", required_argument, nullptr, kModel},
                          {"threshold", required_argument, nullptr, kThreshold},
                          {"draw", required_argument, nullptr, kDraw},
                          {"threads", required_argument, nullptr, kThreads},
                          {"help", no_argument, nullptr, kHelp},
                          {nullptr, 0, nullptr, 0}};
  Options options;
  opterr = 0;
  for (int flag = 0; (flag = getopt_long(argc, argv, "", flags, nullptr)) != -1;) {
    switch (flag) {
      case kModel:
        options.model = optarg;
        break;
      case kThreshold:
        options.threshold = ParseFlagNumber("--threshold", optarg, 0.001, 0.999);
        break;
      case kDraw:
        options.draw = optarg;
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
  options.images.assign(argv + optind, argv + argc);
  if (options.images.empty()) throw Error("no image given, accepted is IMAGE..., see --help");
  if (!options.draw.empty() && options.images.size() != 1) {
    throw Error("option --draw is given with " + std::to_string(options.images.size()) +
                " images, accepted is one");
  }
  if (options.model.empty()) options.model = DefaultModelPath();
  return options;
}

nlohmann::ordered_json ToJson(const std::string& path, cv::Size size,
                              const std::vector<HazardDetection>& found) {
  nlohmann::ordered_json json = {{"image", path},
                                 {"width", size.width},
                                 {"height", size.height},
                                 {"detections", nlohmann::ordered_json::array()}};
  for (const HazardDetection& detection : found) {
    json["detections"].push_back(
        {{"class", detection.class_name},
         {"confidence", detection.confidence},
         {"box", {detection.box.x, detection.box.y, detection.box.br().x, detection.box.br().y}}});
  }
  return json;
}

void Draw(cv::Mat image, const std::vector<HazardDetection>& found, const std::string& path) {
  AnnotateImage(image, found);
  bool written = false;
  try {
    written = cv::imwrite(path, image);
  } catch (const cv::Exception&) {  // an unknown extension
  }
  if (!written)
    throw Error("cannot write '" + path + "', accepted is a path ending in .jpg or .png");
}

int Run(int argc, char** argv) {
  const std::optional<Options> options = ParseOptions(argc, argv);
  if (!options) return 0;
  ModelManifest manifest = ReadModelManifest(options->model);
  if (options->threshold) {
    std::fill(manifest.thresholds.begin(), manifest.thresholds.end(),
              static_cast<float>(*options->threshold));
  }
  HazardDetector detector(manifest, options->threads);
  for (const std::string& path : options->images) {
    const cv::Mat image = ReadImage(path);
    const std::vector<HazardDetection> found = detector.Detect(image);
    using Json = nlohmann::ordered_json;
    // A path need not be UTF-8: what is not is replaced.
    std::cout
        << ToJson(path, image.size(), found).dump(-1, ' ', false, Json::error_handler_t::replace)
        << "\n";
    if (!options->draw.empty()) Draw(image, found, options->draw);
  }
  return 0;
}

}  // namespace
}  // namespace livemap

int main(int argc, char** argv) {
  return livemap::RunTool("livemap_detect_image", [&] { return livemap::Run(argc, argv); });
}
