#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "inference/model_manifest.h"

namespace livemap {

/// Runs one network. Not thread-safe: one engine per thread.
class InferenceEngine {
 public:
  virtual ~InferenceEngine() = default;

  /// `images`: continuous float32 of 1 x 3 x H x W as the manifest says. Returns continuous float32
  /// of the manifest's OutputShape, valid until the next call. Throws Error when the library fails.
  virtual cv::Mat Run(const cv::Mat& images) = 0;
};

/// The engine of this build (OpenCV DNN on the CPU) for the manifest's model. Checks the file's
/// hash and, by running the network once, its input and output shapes; throws Error on any
/// difference. `threads` > 0 sets OpenCV's pool, which is one for the process; 0 leaves it alone.
std::unique_ptr<InferenceEngine> MakeInferenceEngine(const ModelManifest& manifest, int threads);

}  // namespace livemap
