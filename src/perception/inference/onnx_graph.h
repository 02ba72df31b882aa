#pragma once

#include <opencv2/dnn.hpp>
#include <string>
#include <utility>
#include <vector>

#include "perception/inference/onnx_inputs.h"

namespace livemap::perception {

/// An ONNX graph with any number of inputs and outputs on OpenCV's DNN module, on the CPU. Not
/// thread-safe.
class OnnxGraph {
 public:
  /// `bytes`: the content of `file`, which errors name. Throws Error when OpenCV cannot load it.
  OnnxGraph(std::string file, const std::string& bytes);

  const std::string& file() const { return file_; }
  /// As the file declares them; OpenCV itself does not hold a tensor against them.
  const std::vector<OnnxInput>& inputs() const { return inputs_; }
  /// In alphabetical order.
  const std::vector<std::string>& outputs() const { return outputs_; }

  /// Throws Error unless there is an input of this name and shape.
  void RequireInput(const std::string& name, const std::vector<std::int64_t>& shape) const;

  /// Sets the inputs by name (continuous float32) and computes. Returns the outputs in the order of
  /// `outputs()`, valid until the next call. Throws Error when the library fails.
  std::vector<cv::Mat> Run(const std::vector<std::pair<std::string, cv::Mat>>& inputs);

 private:
  std::string file_;
  std::vector<OnnxInput> inputs_;
  std::vector<std::string> outputs_;
  cv::dnn::Net network_;
};

}  // namespace livemap::perception
