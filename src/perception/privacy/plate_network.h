#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "perception/inference/letterbox.h"
#include "perception/inference/onnx_graph.h"
#include "perception/privacy/privacy_networks.h"
#include "perception/privacy/scored_box.h"

namespace livemap::perception {

/// Number plates by LPD-YuNet of OpenCV's model zoo. It was trained on plates that fill a good part
/// of the picture: who gives it a vehicle, enlarged, finds what it misses in a whole street. Not
/// thread-safe.
class PlateNetwork {
 public:
  /// Throws Error when the file is not the manifest's, or does not run on the manifest's input.
  explicit PlateNetwork(const PrivacyNetworks::Network& network);

  /// Plates in `bgr` (8 bit, 3 channels, not empty), in pixels of it; they may reach beyond it.
  /// Throws Error when the network's answer is no answer.
  std::vector<ScoredBox> Find(const cv::Mat& bgr);

 private:
  OnnxGraph graph_;
  cv::Size input_;
  float found_;
  Letterbox letterbox_;
};

/// The answer of the network for an input of this size, N anchors: `conf` of N x 2, no plate and
/// plate, `iou` of N x 1, how well it trusts the place, and `loc` of N x 14, of which numbers 4 to
/// 7 and 10 to 13 are the four corners relative to the anchor. A plate's box is that around its
/// corners, its score the root of both. `scale` is input pixels per pixel of the picture. Throws
/// Error when a shape is another, a number is not finite or a score lies beyond 0 to 1. Descending
/// scores, overlaps suppressed.
std::vector<ScoredBox> DecodePlates(const cv::Mat& conf, const cv::Mat& iou, const cv::Mat& loc,
                                    cv::Size input, double scale, float found);

/// Anchors of the network for an input of this size: centre and side, px of the input.
std::vector<cv::Point3f> PlateAnchors(cv::Size input);

}  // namespace livemap::perception
