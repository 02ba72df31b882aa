#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "perception/inference/onnx_graph.h"
#include "perception/privacy/scored_box.h"

namespace livemap::perception {

// What keeps a network's nonsense from passing for "there is no face": every check throws Error,
// and the picture stays in the car. `network` and `output` name what is wrong.

/// Unless these are the graph's outputs, in alphabetical order.
void RequireOutputs(const OnnxGraph& graph, const std::vector<std::string>& outputs);

/// Unless `tensor` is continuous float32 of `rows` rows and `columns` columns, whatever
/// other dimensions of 1 it has, and every number in it is finite.
void RequireNumbers(const cv::Mat& tensor, int rows, int columns, const std::string& network,
                    const std::string& output);

/// Unless `score` lies within 0 to 1, but for rounding.
void RequireScore(float score, const std::string& network);

/// Unless the box of a find is made of finite numbers.
void RequireFinite(const cv::Rect2f& box, const std::string& network);

}  // namespace livemap::perception
