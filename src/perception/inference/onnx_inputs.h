#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace livemap::perception {

/// An input tensor that an ONNX file declares.
struct OnnxInput {
  std::string name;
  std::vector<std::int64_t> shape;  ///< -1 for a dimension without a fixed size.
};

/// The declared inputs of an ONNX model given as the bytes of its file. OpenCV 4.6 neither tells
/// nor enforces them, and a fully convolutional network runs on any size, so they are read here:
/// fields ModelProto.graph = 7, GraphProto.input = 11, ValueInfoProto.name = 1 and .type = 2,
/// TypeProto.tensor_type = 1, Tensor.shape = 2, TensorShapeProto.dim = 1, Dimension.dim_value = 1
/// of onnx.proto. Throws Error when the bytes are no such message.
std::vector<OnnxInput> ReadOnnxInputs(std::string_view model);

}  // namespace livemap::perception
