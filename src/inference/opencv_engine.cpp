#include <algorithm>
#include <opencv2/dnn.hpp>
#include <string>

#include "base/error.h"
#include "inference/inference_engine.h"
#include "inference/onnx_inputs.h"

namespace livemap {
namespace {

constexpr char kInputName[] = "images";

template <typename Sizes>
std::string ShapeText(const Sizes& sizes) {
  std::string text;
  for (const auto size : sizes) {
    text += (text.empty() ? "" : " x ") + (size < 0 ? "?" : std::to_string(size));
  }
  return text.empty() ? "no dimensions" : text;
}

std::vector<std::int64_t> ShapeOf(const cv::Mat& tensor) {
  return {tensor.size.p, tensor.size.p + tensor.dims};
}

/// OpenCV's messages run over several lines; errors here are one sentence.
std::string OneLine(std::string text) {
  text.erase(std::remove(text.begin(), text.end(), '\n'), text.end());
  return text;
}

/// OpenCV's DNN module on the CPU.
class OpenCvEngine final : public InferenceEngine {
 public:
  explicit OpenCvEngine(const ModelManifest& manifest) : file_(manifest.file) {
    const std::string bytes = ReadModelFile(manifest);
    CheckInput(bytes, manifest);
    try {
      network_ = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
      network_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
      network_.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
    } catch (const cv::Exception& error) {
      throw Error("model file '" + file_ +
                  "' cannot be loaded, accepted is an ONNX file of layers that OpenCV knows (" +
                  OneLine(error.err) + ")");
    }
    CheckOutput(manifest);
  }

  cv::Mat Run(const cv::Mat& images) override {
    try {
      network_.setInput(images, kInputName);
      return network_.forward();
    } catch (const cv::Exception& error) {
      throw Error("model file '" + file_ + "' cannot run on an input of " +
                  ShapeText(ShapeOf(images)) + " (" + OneLine(error.err) + ")");
    }
  }

 private:
  void CheckInput(const std::string& bytes, const ModelManifest& manifest) const {
    std::vector<OnnxInput> inputs;
    try {
      inputs = ReadOnnxInputs(bytes);
    } catch (const Error& error) {
      throw Error("model file '" + file_ + "' cannot be loaded: " + error.what());
    }
    const auto images = std::find_if(inputs.begin(), inputs.end(), [](const OnnxInput& input) {
      return input.name == kInputName;
    });
    if (images == inputs.end()) {
      throw Error("model file '" + file_ + "' declares " + std::to_string(inputs.size()) +
                  " inputs of other names, accepted is one named '" + kInputName + "'");
    }
    const std::vector<std::int64_t> shape = {1, 3, manifest.input.height, manifest.input.width};
    if (images->shape != shape) {
      throw Error("model file '" + file_ + "' takes images of " + ShapeText(images->shape) +
                  ", its manifest accepts " + ShapeText(shape));
    }
  }

  /// Runs the network once, which also makes the first frame as fast as the others.
  void CheckOutput(const ModelManifest& manifest) {
    const std::vector<std::string> outputs = network_.getUnconnectedOutLayersNames();
    if (outputs.size() != 1 || outputs[0] != manifest.head.output) {
      throw Error("model file '" + file_ + "' has " + std::to_string(outputs.size()) +
                  " outputs, the first named '" + (outputs.empty() ? "" : outputs[0]) +
                  "', its manifest accepts one named '" + manifest.head.output + "'");
    }
    const int images_shape[] = {1, 3, manifest.input.height, manifest.input.width};
    const cv::Mat output = Run(cv::Mat(4, images_shape, CV_32F, cv::Scalar(0)));
    const std::vector<std::int64_t> shape = manifest.OutputShape();
    if (output.type() != CV_32F || ShapeOf(output) != shape) {
      throw Error("model file '" + file_ + "' answers with a tensor of " +
                  ShapeText(ShapeOf(output)) + ", its manifest of " +
                  std::to_string(manifest.classes.size()) + " classes accepts " + ShapeText(shape));
    }
  }

  std::string file_;
  cv::dnn::Net network_;
};

}  // namespace

std::unique_ptr<InferenceEngine> MakeInferenceEngine(const ModelManifest& manifest, int threads) {
  if (threads > 0) cv::setNumThreads(threads);
  return std::make_unique<OpenCvEngine>(manifest);
}

}  // namespace livemap
