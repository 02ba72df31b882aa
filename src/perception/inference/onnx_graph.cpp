#include "perception/inference/onnx_graph.h"

#include <algorithm>

#include "common/error.h"
#include "perception/inference/engines.h"

namespace livemap::perception {
namespace {

/// OpenCV's messages run over several lines; errors here are one sentence.
std::string OneLineOfOnnxError(std::string text) {
  text.erase(std::remove(text.begin(), text.end(), '\n'), text.end());
  return text;
}

}  // namespace

OnnxGraph::OnnxGraph(std::string file, const std::string& bytes) : file_(std::move(file)) {
  try {
    inputs_ = ReadOnnxInputs(bytes);
  } catch (const Error& error) {
    throw Error("model file '" + file_ + "' cannot be loaded: " + error.what());
  }
  try {
    network_ = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
    network_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    network_.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
    outputs_ = network_.getUnconnectedOutLayersNames();
  } catch (const cv::Exception& error) {
    throw Error("model file '" + file_ +
                "' cannot be loaded, accepted is an ONNX file of layers that OpenCV knows (" +
                OneLineOfOnnxError(error.err) + ")");
  }
  std::sort(outputs_.begin(), outputs_.end());
}

void OnnxGraph::RequireInput(const std::string& name,
                             const std::vector<std::int64_t>& shape) const {
  const auto input = std::find_if(inputs_.begin(), inputs_.end(),
                                  [&](const OnnxInput& each) { return each.name == name; });
  if (input == inputs_.end()) {
    throw Error("model file '" + file_ + "' declares " + std::to_string(inputs_.size()) +
                " inputs of other names, accepted is one named '" + name + "'");
  }
  if (input->shape != shape) {
    throw Error("model file '" + file_ + "' takes " + name + " of " + ShapeText(input->shape) +
                ", its manifest accepts " + ShapeText(shape));
  }
}

std::vector<cv::Mat> OnnxGraph::Run(const std::vector<std::pair<std::string, cv::Mat>>& inputs) {
  std::vector<cv::Mat> answers;
  std::string shapes;
  try {
    for (const auto& [name, tensor] : inputs) {
      shapes += (shapes.empty() ? "" : ", ") + ShapeText(ShapeOf(tensor));
      network_.setInput(tensor, name);
    }
    network_.forward(answers, outputs_);
  } catch (const cv::Exception& error) {
    throw Error("model file '" + file_ + "' cannot run on an input of " + shapes + " (" +
                OneLineOfOnnxError(error.err) + ")");
  }
  return answers;
}

}  // namespace livemap::perception
