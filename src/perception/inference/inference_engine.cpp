#include "perception/inference/inference_engine.h"

#include "common/error.h"
#include "perception/inference/engines.h"
#include "perception/inference/processor.h"

namespace livemap::perception {

std::string ShapeText(const std::vector<std::int64_t>& sizes) {
  std::string text;
  for (const std::int64_t size : sizes) {
    text += (text.empty() ? "" : " x ") + (size < 0 ? "?" : std::to_string(size));
  }
  return text.empty() ? "no dimensions" : text;
}

std::vector<std::int64_t> ShapeOf(const cv::Mat& tensor) {
  return {tensor.size.p, tensor.size.p + tensor.dims};
}

std::vector<std::int64_t> InputShape(const ModelManifest& manifest) {
  return {1, 3, manifest.input.height, manifest.input.width};
}

std::string FirstLine(const std::string& text) { return text.substr(0, text.find('\n')); }

void CheckOutput(InferenceEngine& engine, const ModelManifest& manifest, const std::string& file) {
  const int shape[] = {1, 3, manifest.input.height, manifest.input.width};
  const bool pixels = engine.ComputesIn() == Precision::kInt8;
  const cv::Mat output = engine.Run(
      pixels ? cv::Mat(manifest.input.height, manifest.input.width, CV_8UC3, cv::Scalar())
             : cv::Mat(4, shape, CV_32F, cv::Scalar(0)));
  const std::vector<std::int64_t> promised = manifest.OutputShape();
  if (output.type() != CV_32F || ShapeOf(output) != promised) {
    throw Error("model file '" + file + "' answers with a tensor of " + ShapeText(ShapeOf(output)) +
                ", its manifest of " + std::to_string(manifest.classes.size()) +
                " classes accepts " + ShapeText(promised));
  }
}

std::optional<EngineKind> ParseEngineChoice(const std::string& text, const std::string& what) {
  if (text == "auto") return std::nullopt;
  if (text == "opencv") return EngineKind::kOpenCv;
  if (text == "torch") return EngineKind::kTorch;
  throw Error(what + " is '" + text.substr(0, 80) + "', accepted are auto, opencv and torch");
}

std::string NameOf(EngineKind kind) { return kind == EngineKind::kTorch ? "torch" : "opencv"; }

std::string NameOf(Precision precision) { return precision == Precision::kInt8 ? "int8" : "fp32"; }

std::unique_ptr<InferenceEngine> MakeInferenceEngine(const ModelManifest& manifest, int threads,
                                                     std::optional<EngineKind> choice) {
  const EngineKind own = HasTorchEngine() || manifest.engine == EngineKind::kOpenCv
                             ? manifest.engine
                             : EngineKind::kOpenCv;
  if (choice.value_or(own) == EngineKind::kOpenCv) return MakeOpenCvEngine(manifest, threads);
  return manifest.precision == Precision::kInt8 && HasInt8Instructions()
             ? MakeInt8Engine(manifest, threads)
             : MakeTorchEngine(manifest, threads);
}

}  // namespace livemap::perception
