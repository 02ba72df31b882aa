#pragma once

#include <array>
#include <opencv2/core.hpp>

#include "perception/inference/model_manifest.h"

namespace livemap::perception {

/// Turns images of any size into the network's input tensor. Keeps its buffers between calls.
class Letterbox {
 public:
  Letterbox(const ModelManifest::Input& input, const ModelManifest::Normalisation& normalisation);
  explicit Letterbox(const ModelManifest& manifest)
      : Letterbox(manifest.input, manifest.normalisation) {}

  /// `bgr` (8 bit, 3 channels, not empty; anything else throws Error) scaled to fit by linear
  /// interpolation, padded right and bottom, normalised: 1 x 3 x H x W float32, valid until the
  /// next call.
  const cv::Mat& Fill(const cv::Mat& bgr);

  /// The same without the normalisation: H x W x 3 of 8 bits, in the network's order of channels,
  /// valid until the next call.
  const cv::Mat& FillPixels(const cv::Mat& bgr);

  /// Pixels of the input per pixel of an image of `size`.
  double Scale(cv::Size size) const;
  /// What an image of `size` is scaled to before it is padded; pixels of the input.
  cv::Size Fitted(cv::Size size) const;

 private:
  /// `bgr` scaled to fit: itself where it fits already. Throws Error.
  cv::Mat Scaled(const cv::Mat& bgr);

  ModelManifest::Input input_;
  std::array<int, 3> source_channel_{};                 // BGR index of each plane of the tensor
  std::array<std::array<float, 256>, 3> normalised_{};  // by plane and pixel value
  cv::Mat scaled_;
  cv::Mat tensor_;
  cv::Mat pixels_;
};

}  // namespace livemap::perception
