#pragma once

#include <opencv2/core.hpp>

#include "perception/inference/model_manifest.h"

namespace livemap::perception {

/// A manifest for a head of two levels and two classes, input 64 x 48 px; no model file.
inline ModelManifest TwoLevelManifest() {
  ModelManifest manifest;
  manifest.name = "synthetic";
  manifest.classes = {"pothole", "traffic_cone"};
  manifest.input.width = 64;
  manifest.input.height = 48;
  manifest.input.pad_value = 114;
  manifest.normalisation.mean = {10, 20, 30};
  manifest.normalisation.std = {1, 2, 4};
  manifest.head.strides = {8, 16};
  manifest.head.output = "predictions";
  manifest.thresholds = {0.5F, 0.8F};
  manifest.nms_iou = 0.5F;
  return manifest;
}

/// An output of that head in which nothing is seen.
inline cv::Mat NothingSeen(const ModelManifest& manifest) {
  const int shape[] = {1, manifest.AnchorCount(), 5 + static_cast<int>(manifest.classes.size())};
  return {3, shape, CV_32F, cv::Scalar(0)};
}

}  // namespace livemap::perception
