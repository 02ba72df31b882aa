#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace livemap::perception {

// Networks that answer the same whatever they are shown, made here as ONNX bytes: what surrounds a
// network (files, crops, checks) is tested with real files and OpenCV's real parser.

/// A number of protocol buffers, 7 bits a byte.
inline std::string OnnxVarint(std::uint64_t value) {
  std::string bytes;
  for (; value >= 128; value >>= 7) bytes += static_cast<char>(128 + value % 128);
  return bytes + static_cast<char>(value);
}

inline std::string OnnxNumber(int field, std::uint64_t value) {
  return OnnxVarint(static_cast<std::uint64_t>(field) << 3) + OnnxVarint(value);
}

inline std::string OnnxBytes(int field, const std::string& value) {
  return OnnxVarint((static_cast<std::uint64_t>(field) << 3) + 2) + OnnxVarint(value.size()) +
         value;
}

template <typename Value>
std::string OnnxTensor(const std::string& name, int type, const std::vector<std::int64_t>& shape,
                       const std::vector<Value>& values) {
  std::string tensor;
  for (const std::int64_t size : shape) tensor += OnnxNumber(1, static_cast<std::uint64_t>(size));
  std::string raw(values.size() * sizeof(Value), '\0');
  std::memcpy(raw.data(), values.data(), raw.size());
  return tensor + OnnxNumber(2, static_cast<std::uint64_t>(type)) + OnnxBytes(8, name) +
         OnnxBytes(9, raw);
}

inline std::string OnnxValue(const std::string& name, const std::vector<std::int64_t>& shape) {
  std::string dims;
  for (const std::int64_t size : shape) {
    dims += OnnxBytes(1, OnnxNumber(1, static_cast<std::uint64_t>(size)));
  }
  const std::string tensor = OnnxNumber(1, 1) + OnnxBytes(2, dims);
  return OnnxBytes(1, name) + OnnxBytes(2, OnnxBytes(1, tensor));
}

inline std::string OnnxNode(const std::string& type, const std::vector<std::string>& inputs,
                            const std::string& output, const std::string& attributes = "") {
  std::string node;
  for (const std::string& input : inputs) node += OnnxBytes(1, input);
  return node + OnnxBytes(2, output) + OnnxBytes(4, type) + attributes;
}

/// kernel_shape = [1, 1] of a convolution.
inline std::string OnnxPointKernel() {
  constexpr int kInts = 7;
  return OnnxBytes(5, OnnxBytes(1, "kernel_shape") + OnnxNumber(8, 1) + OnnxNumber(8, 1) +
                          OnnxNumber(20, kInts));
}

/// What a tiny network answers under one name.
struct TinyOutput {
  std::string name;
  std::vector<std::int64_t> shape;
  std::vector<float> values;
};

/// The ONNX file: the mean of the picture, times 0, plus the values.
inline std::string TinyNetwork(const std::string& input, std::int64_t width, std::int64_t height,
                               const std::vector<TinyOutput>& outputs) {
  constexpr int kFloat = 1;
  constexpr int kInt64 = 7;
  std::string graph = OnnxBytes(1, OnnxNode("GlobalAveragePool", {input}, "mean"));
  std::string initializers;
  std::string ends;
  for (const TinyOutput& each : outputs) {
    const auto count = static_cast<std::int64_t>(each.values.size());
    const std::string& name = each.name;
    graph += OnnxBytes(
        1, OnnxNode("Conv", {"mean", name + "_w", name + "_b"}, name + "_flat", OnnxPointKernel()));
    graph += OnnxBytes(1, OnnxNode("Reshape", {name + "_flat", name + "_shape"}, name));
    initializers += OnnxBytes(5, OnnxTensor<float>(name + "_w", kFloat, {count, 3, 1, 1},
                                                   std::vector<float>(3 * each.values.size(), 0)));
    initializers += OnnxBytes(5, OnnxTensor<float>(name + "_b", kFloat, {count}, each.values));
    initializers += OnnxBytes(
        5, OnnxTensor<std::int64_t>(name + "_shape", kInt64,
                                    {static_cast<std::int64_t>(each.shape.size())}, each.shape));
    ends += OnnxBytes(12, OnnxValue(name, each.shape));
  }
  graph += OnnxBytes(2, "tiny") + initializers;
  graph += OnnxBytes(11, OnnxValue(input, {1, 3, height, width})) + ends;
  return OnnxNumber(1, 7) + OnnxBytes(7, graph) + OnnxBytes(8, OnnxNumber(2, 11));
}

}  // namespace livemap::perception
