#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "perception/inference/letterbox.h"
#include "perception/inference/onnx_graph.h"
#include "perception/privacy/privacy_networks.h"
#include "perception/privacy/scored_box.h"

namespace livemap::perception {

/// Faces by UltraFace ("Ultra-Light-Fast-Generic-Face-Detector-1MB", RFB-320). Not thread-safe.
class FaceNetwork {
 public:
  /// Throws Error when the file is not the manifest's, or does not run on the manifest's input.
  explicit FaceNetwork(const PrivacyNetworks::Network& network);

  /// Faces in `bgr` (8 bit, 3 channels, not empty), in pixels of it; they may reach beyond it.
  /// Throws Error when the network's answer is no answer.
  std::vector<ScoredBox> Find(const cv::Mat& bgr);

 private:
  OnnxGraph graph_;
  cv::Size input_;
  float found_;
  Letterbox letterbox_;
};

/// The answer of the network: `boxes` of N x 4, the corners x_min, y_min, x_max, y_max as shares of
/// the input's sides, and `scores` of N x 2, no face and face. `scale` is input pixels per pixel of
/// the picture. Throws Error when a shape is another, a number is not finite or a score lies beyond
/// 0 to 1. Descending scores, overlaps suppressed.
std::vector<ScoredBox> DecodeFaces(const cv::Mat& boxes, const cv::Mat& scores, cv::Size input,
                                   double scale, float found);

}  // namespace livemap::perception
