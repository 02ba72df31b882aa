#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "perception/inference/model_manifest.h"

namespace livemap::perception {

/// Runs one network. Not thread-safe: one engine per thread.
class InferenceEngine {
 public:
  virtual ~InferenceEngine() = default;

  /// `images`: continuous float32 of 1 x 3 x H x W as the manifest says (Letterbox::Fill), or, in
  /// 8 bits, its pixels, H x W x 3 (Letterbox::FillPixels). Returns continuous float32 of the
  /// manifest's OutputShape, valid until the next call. Throws Error when the library fails.
  virtual cv::Mat Run(const cv::Mat& images) = 0;

  /// The same of the network's first view alone (ModelManifest::Head::views): its rows and no
  /// others, where the engine computes views apart, for less than half the time. Others return what
  /// Run does.
  virtual cv::Mat RunFirstView(const cv::Mat& images) { return Run(images); }

  /// The library that runs it: kOpenCv or kTorch.
  virtual EngineKind Kind() const = 0;

  /// The numbers it computes in; kInt8 wants pixels.
  virtual Precision ComputesIn() const { return Precision::kFp32; }
};

/// Which library runs a network, as a parameter or a flag says it: "opencv", "torch", or "auto",
/// which leaves the choice to the manifest (none). Throws Error for any other text; `what` names
/// the parameter there.
std::optional<EngineKind> ParseEngineChoice(const std::string& text, const std::string& what);

/// "opencv" or "torch".
std::string NameOf(EngineKind kind);

/// "fp32" or "int8".
std::string NameOf(Precision precision);

/// Whether this build has libtorch.
bool HasTorchEngine();

/// An engine for the manifest's model, on the CPU. `choice` none: the manifest's own choice, or
/// OpenCV where that is torch and this build has no libtorch. Checks the file's hash and, by
/// running the network once, its input and output shapes; throws Error on any difference, and when
/// libtorch is asked for but is not in this build or has no file in the manifest.
///
/// libtorch runs it in the manifest's precision, but in float32 where the processor has no
/// instructions for 8 bits (HasInt8Instructions).
///
/// `threads` > 0: OpenCV's pool has so many threads, one pool for the process, whoever set it last.
/// libtorch's count holds for the calling thread alone: N engines on their own threads compute with
/// N x `threads` threads. 0 leaves OpenCV's pool alone and gives libtorch one thread per core.
std::unique_ptr<InferenceEngine> MakeInferenceEngine(const ModelManifest& manifest, int threads,
                                                     std::optional<EngineKind> choice = {});

}  // namespace livemap::perception
