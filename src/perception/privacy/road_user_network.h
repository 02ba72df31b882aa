#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "perception/inference/inference_engine.h"
#include "perception/inference/letterbox.h"
#include "perception/privacy/privacy_networks.h"

namespace livemap::perception {

/// Where faces and number plates may be: the boxes of people and vehicles, px of the picture and
/// inside it.
struct RoadUsers {
  std::vector<cv::Rect2f> people;
  std::vector<cv::Rect2f> vehicles;  ///< Cars, motorcycles, buses and trucks.
};

/// People and vehicles by a YOLOX network of COCO's 80 classes. Not thread-safe.
class RoadUserNetwork {
 public:
  /// Throws Error when the file is not the manifest's, or does not run on the manifest's input.
  explicit RoadUserNetwork(const PrivacyNetworks::Network& network);

  /// Those in `bgr` (8 bit, 3 channels, not empty). One that is taken for two kinds of vehicle is
  /// there once. Throws Error when the network's answer is no answer.
  RoadUsers Find(const cv::Mat& bgr);

 private:
  ModelManifest manifest_;
  std::unique_ptr<InferenceEngine> engine_;
  Letterbox letterbox_;
};

/// The answer of the network as DecodeYolox takes it, with `manifest` of COCO's classes. Throws
/// Error when its shape is another or a number is not finite.
RoadUsers DecodeRoadUsers(const cv::Mat& predictions, const ModelManifest& manifest, double scale,
                          cv::Size picture);

/// The network's manifest in the form of a detector's.
ModelManifest RoadUserManifest(const PrivacyNetworks::Network& network);

}  // namespace livemap::perception
