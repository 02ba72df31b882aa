#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "perception/detection/hazard_detection.h"
#include "perception/detection/view_fusion.h"
#include "perception/inference/inference_engine.h"
#include "perception/inference/letterbox.h"
#include "perception/inference/model_manifest.h"

namespace livemap::perception {

/// What a network that looks more than once (ModelManifest::Head::views) looks at.
enum class Look {
  kAllViews,
  /// The first view alone, where the engine computes views apart: for who has no time for all.
  kFirstView,
};

/// Finds hazards in single images: letterbox, network, decoding, thresholds, suppression. Not
/// thread-safe: one detector per thread.
class HazardDetector {
 public:
  /// Loads the model; throws Error when it is not what the manifest says. `threads` and `engine` as
  /// in MakeInferenceEngine.
  explicit HazardDetector(const ModelManifest& manifest, int threads = 0,
                          std::optional<EngineKind> engine = {});
  /// With another engine, which must have been made for the same manifest.
  HazardDetector(const ModelManifest& manifest, std::unique_ptr<InferenceEngine> engine);

  /// Detections in `bgr` (8 bit, 3 channels, not empty; anything else throws Error), in pixels of
  /// that image, descending confidence.
  std::vector<HazardDetection> Detect(const cv::Mat& bgr, Look look = Look::kAllViews);

  const ModelManifest& manifest() const { return manifest_; }
  /// The library that runs it.
  EngineKind Engine() const { return engine_->Kind(); }
  /// The numbers it computes in.
  Precision ComputesIn() const { return engine_->ComputesIn(); }

 private:
  DetectionsOfViews Views(const cv::Mat& bgr, Look look);

  ModelManifest manifest_;
  std::unique_ptr<InferenceEngine> engine_;
  Letterbox letterbox_;
  cv::Mat mirrored_;  // Its memory serves again.
};

}  // namespace livemap::perception
