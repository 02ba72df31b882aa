#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace livemap::odometry {

/// Canny's edges (1986) as cv::Canny finds them with a 3x3 Sobel operator and the L1 norm, but with
/// thresholds from the image, in about 0.6 of its time and without allocating once its buffers
/// have the image's size. Not thread-safe.
class CannyDetector {
 public:
  static constexpr double kWeakOfStrong = 0.4;  ///< Ratio of the two thresholds.

  /// CV_8UC1 of the image's size, 255 at edges; valid until the next call. The `strong_share` of
  /// the pixels with the largest gradients start an edge, unless these are below `min_gradient`
  /// (grey levels per px); pixels of at least kWeakOfStrong of that gradient continue it.
  const cv::Mat& Extract(const cv::Mat& grey, double strong_share, double min_gradient);
  /// Memory for images up to this size.
  void Reserve(cv::Size size);
  /// The same with given thresholds, L1 norm of Sobel's response.
  const cv::Mat& ExtractAbove(const cv::Mat& grey, int weak, int strong);

  /// Gradients of the last image, CV_16SC1, Sobel's response: 8 per grey level per px.
  const cv::Mat& dx() const { return dx_; }
  const cv::Mat& dy() const { return dy_; }
  /// L1 norm that the share exceeds, at least `least`; of a sixteenth of the pixels.
  int StrongThreshold(double strong_share, double min_gradient) const;
  /// The gradients alone.
  void Differentiate(const cv::Mat& grey);

 private:
  void ThinAbove(int weak, int strong);
  void FollowEdges();

  cv::Mat dx_memory_, dy_memory_, norm_memory_, edges_memory_;
  cv::Mat dx_, dy_, norm_, edges_;  // Parts of the memory, of the image's size.
  std::vector<std::int16_t> smooth_, difference_;
  std::vector<std::uint8_t*> open_;  // Strong pixels whose neighbours are not looked at yet.
};

}  // namespace livemap::odometry
