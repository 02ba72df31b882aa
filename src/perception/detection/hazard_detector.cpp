#include "perception/detection/hazard_detector.h"

#include <utility>

#include "common/error.h"
#include "perception/detection/yolox_decoder.h"

namespace livemap::perception {

HazardDetector::HazardDetector(const ModelManifest& manifest, int threads,
                               std::optional<EngineKind> engine)
    : HazardDetector(manifest, MakeInferenceEngine(manifest, threads, engine)) {}

HazardDetector::HazardDetector(const ModelManifest& manifest,
                               std::unique_ptr<InferenceEngine> engine)
    : manifest_(manifest), engine_(std::move(engine)), letterbox_(manifest) {
  if (manifest_.head.type != HeadType::kYolox) {
    throw Error("model '" + manifest_.name +
                "' has a head of type 'score', a detector needs one of type 'yolox'");
  }
}

std::vector<HazardDetection> HazardDetector::Detect(const cv::Mat& bgr, Look look) {
  DetectionsOfViews views = Views(bgr, look);
  if (manifest_.head.mirrored && look == Look::kAllViews) {
    cv::flip(bgr, mirrored_, 1);
    for (std::vector<HazardDetection>& view : Mirrored(Views(mirrored_, look), bgr.cols)) {
      views.push_back(std::move(view));
    }
  }
  return JoinViews(std::move(views), manifest_);
}

DetectionsOfViews HazardDetector::Views(const cv::Mat& bgr, Look look) {
  const cv::Mat input =
      ComputesIn() == Precision::kInt8 ? letterbox_.FillPixels(bgr) : letterbox_.Fill(bgr);
  const cv::Mat predictions =
      look == Look::kAllViews ? engine_->Run(input) : engine_->RunFirstView(input);
  return DecodeViews(predictions, manifest_, letterbox_.Scale(bgr.size()), bgr.size());
}

}  // namespace livemap::perception
