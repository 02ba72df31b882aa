#include <string>

#include "common/error.h"
#include "perception/inference/engines.h"
#include "perception/inference/onnx_graph.h"

namespace livemap::perception {
namespace {

constexpr char kInputName[] = "images";

/// OpenCV's DNN module on the CPU.
class OpenCvEngine final : public InferenceEngine {
 public:
  explicit OpenCvEngine(const ModelManifest& manifest)
      : graph_(manifest.file, ReadModelFile(manifest)) {
    graph_.RequireInput(kInputName, InputShape(manifest));
    CheckOutputName(manifest);
    CheckOutput(*this, manifest, manifest.file);
  }

  cv::Mat Run(const cv::Mat& images) override { return graph_.Run({{kInputName, images}})[0]; }

  EngineKind Kind() const override { return EngineKind::kOpenCv; }

 private:
  void CheckOutputName(const ModelManifest& manifest) const {
    const std::vector<std::string>& outputs = graph_.outputs();
    if (outputs.size() != 1 || outputs[0] != manifest.head.output) {
      throw Error("model file '" + manifest.file + "' has " + std::to_string(outputs.size()) +
                  " outputs, the first named '" + (outputs.empty() ? "" : outputs[0]) +
                  "', its manifest accepts one named '" + manifest.head.output + "'");
    }
  }

  OnnxGraph graph_;
};

}  // namespace

std::unique_ptr<InferenceEngine> MakeOpenCvEngine(const ModelManifest& manifest, int threads) {
  if (threads > 0) cv::setNumThreads(threads);
  return std::make_unique<OpenCvEngine>(manifest);
}

}  // namespace livemap::perception
