#include "perception/privacy/network_answer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "common/error.h"

namespace livemap::perception {

void RequireOutputs(const OnnxGraph& graph, const std::vector<std::string>& outputs) {
  if (graph.outputs() == outputs) return;
  const auto listed = [](const std::vector<std::string>& names) {
    std::string list;
    for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
    return list;
  };
  throw Error("model file '" + graph.file() + "' has the outputs " + listed(graph.outputs()) +
              ", accepted are " + listed(outputs));
}

void RequireNumbers(const cv::Mat& tensor, int rows, int columns, const std::string& network,
                    const std::string& output) {
  const std::size_t expected = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  const bool is_shaped = tensor.type() == CV_32F && tensor.isContinuous() && tensor.dims >= 2 &&
                         tensor.total() == expected && tensor.size[tensor.dims - 1] == columns &&
                         tensor.size[tensor.dims - 2] == rows;
  if (!is_shaped) {
    throw Error("output '" + output + "' of model '" + network +
                "' has another shape, accepted is float32 of " + std::to_string(rows) + " x " +
                std::to_string(columns));
  }
  const float* values = tensor.ptr<float>();
  if (!std::all_of(values, values + expected, [](float value) { return std::isfinite(value); })) {
    throw Error("output '" + output + "' of model '" + network +
                "' has numbers that are not finite, so nobody knows what is in the picture");
  }
}

void RequireScore(float score, const std::string& network) {
  constexpr float kRounding = 1e-3F;
  // Written so that NaN is refused too.
  if (!(score >= -kRounding && score <= 1 + kRounding)) {
    throw Error("a score of model '" + network + "' is " + std::to_string(score) +
                ", accepted is 0 to 1");
  }
}

void RequireFinite(const cv::Rect2f& box, const std::string& network) {
  if (std::isfinite(box.x) && std::isfinite(box.y) && std::isfinite(box.width) &&
      std::isfinite(box.height)) {
    return;
  }
  throw Error("a find of model '" + network + "' has no place in the picture, accepted are boxes " +
              "of finite numbers");
}

}  // namespace livemap::perception
