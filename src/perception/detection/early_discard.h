#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "perception/inference/inference_engine.h"
#include "perception/inference/letterbox.h"
#include "perception/inference/model_manifest.h"

namespace livemap::perception {

/// The small vehicle's send / don't-send decision (thesis, section 3.2.4): how likely an image is
/// worth the zone's detector. Not thread-safe: one per thread.
class EarlyDiscard {
 public:
  /// Loads the model; throws Error when it is not what the manifest says, or when its head is not
  /// of type score with one class. `threads` as in MakeInferenceEngine.
  explicit EarlyDiscard(const ModelManifest& manifest, int threads = 0);
  /// With another engine, which must have been made for the same manifest.
  EarlyDiscard(const ModelManifest& manifest, std::unique_ptr<InferenceEngine> engine);

  /// 0..1 for `bgr` (8 bit, 3 channels, not empty; anything else throws Error, as does an answer
  /// that is no number).
  float Score(const cv::Mat& bgr);

  /// The least score that is sent: the manifest's threshold.
  float threshold() const { return manifest_.thresholds.front(); }
  const ModelManifest& manifest() const { return manifest_; }

 private:
  ModelManifest manifest_;
  std::unique_ptr<InferenceEngine> engine_;
  Letterbox letterbox_;
};

}  // namespace livemap::perception
