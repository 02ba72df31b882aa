// livemap_detect_image: what a model finds in single images.

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "common/error.h"
#include "perception/detection/annotation.h"
#include "perception/detection/hazard_detector.h"
#include "tools/common/command_line.h"
#include "tools/common/shipped_model.h"
#include "tools/detection/detection_tool_support.h"

namespace livemap::tools {
namespace {

struct Options {
  std::vector<std::string> images;
  std::string model;
  std::string draw;
  std::optional<double> threshold;
  int threads = 0;
  std::optional<perception::EngineKind> engine;
};

/// Before the work: what cannot be written is refused.
void CheckDetectImageOutput(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder)) {
    throw Error("--draw is '" + path + "', whose folder does not exist");
  }
  const std::string kind = std::filesystem::path(path).extension().string();
  if (kind != ".jpg" && kind != ".jpeg" && kind != ".png") {
    throw Error("--draw is '" + path + "', accepted is a path ending in .jpg or .png");
  }
}

/// None when --help was asked for and printed.
std::optional<Options> ParseDetectImageOptions(int argc, char** argv) {
  CommandLine line(
      "livemap_detect_image [FLAGS] IMAGE...",
      "Prints what the detector finds in each image, one line of JSON per image:\n"
      "{\"image\":...,\"width\":w,\"height\":h,\n"
      " \"detections\":[{\"class\":...,\"confidence\":c,\"box\":[x1,y1,x2,y2]}]}",
      CommandLine::kOneOrMore,
      {{"model", "FILE", "manifest of the model, default models/hazards-base.yaml, as a vehicle's"},
       {"threshold", "X", "least confidence, instead of the manifest's"},
       {"draw", "FILE", "write the image with what was found drawn in (.jpg or .png; one IMAGE)"},
       {"engine", "NAME", "auto (what the manifest says, default), opencv or torch"},
       {"threads", "N", "threads of the engine, default all cores"}});
  if (!line.Parse(argc, argv)) return std::nullopt;
  Options options;
  options.images = line.Positionals();
  options.model = line.Text("model", "");
  if (options.model.empty()) options.model = ShippedModel(kDefaultDetector);
  options.draw = line.Text("draw", "");
  if (line.Has("threshold")) options.threshold = line.Number("threshold", 0, 0.001, 0.999);
  options.engine = perception::ParseEngineChoice(line.Text("engine", "auto"), "--engine");
  options.threads = line.Whole("threads", 0, 1, 256);
  if (!options.draw.empty() && options.images.size() != 1) {
    throw Error("--draw is given with " + std::to_string(options.images.size()) +
                " images, accepted is one");
  }
  if (!options.draw.empty()) CheckDetectImageOutput(options.draw);
  return options;
}

nlohmann::ordered_json DetectedImageJson(const std::string& path, cv::Size size,
                                         const std::vector<perception::HazardDetection>& found) {
  nlohmann::ordered_json json = {{"image", path},
                                 {"width", size.width},
                                 {"height", size.height},
                                 {"detections", nlohmann::ordered_json::array()}};
  for (const perception::HazardDetection& detection : found) {
    json["detections"].push_back(
        {{"class", detection.class_name},
         {"confidence", detection.confidence},
         {"box", {detection.box.x, detection.box.y, detection.box.br().x, detection.box.br().y}}});
  }
  return json;
}

void DrawDetectedImage(const cv::Mat& image, const std::vector<perception::HazardDetection>& found,
                       const std::string& path) {
  cv::Mat drawn = image;
  perception::AnnotateImage(drawn, found);
  if (!cv::imwrite(path, drawn)) throw Error("'" + path + "' cannot be written");
}

int DetectImage(int argc, char** argv) {
  const std::optional<Options> options = ParseDetectImageOptions(argc, argv);
  if (!options) return 0;
  perception::ModelManifest manifest = perception::ReadModelManifest(options->model);
  if (options->threshold) {
    std::fill(manifest.thresholds.begin(), manifest.thresholds.end(),
              static_cast<float>(*options->threshold));
  }
  perception::HazardDetector detector(manifest, options->threads, options->engine);
  for (const std::string& path : options->images) {
    const cv::Mat image = ReadImage(path);
    const std::vector<perception::HazardDetection> found = detector.Detect(image);
    using Json = nlohmann::ordered_json;
    // A path need not be UTF-8: what is not is replaced.
    std::cout << DetectedImageJson(path, image.size(), found)
                     .dump(-1, ' ', false, Json::error_handler_t::replace)
              << "\n";
    if (!options->draw.empty()) DrawDetectedImage(image, found, options->draw);
  }
  return 0;
}

}  // namespace
}  // namespace livemap::tools

int main(int argc, char** argv) {
  return livemap::tools::RunProgram("livemap_detect_image", argc, argv,
                                    livemap::tools::DetectImage);
}
