#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace livemap::change {

/// Parameters of DAISY, the authors' for wide baselines.
struct DaisyConfig {
  int rings = 3;
  int ring_points = 8;   ///< Histograms on each ring.
  int orientations = 8;  ///< Bins of a histogram.
  float radius_px = 15;  ///< Of the outermost ring.
};

/// The dense descriptor DAISY: at every pixel the histograms of gradient orientations around its
/// centre and around points on rings, which blur the more the further out they lie.
/// Source: E. Tola, V. Lepetit, P. Fua, "DAISY: An Efficient Dense Descriptor Applied to
/// Wide-Baseline Stereo", IEEE PAMI 32(5), 2010, sections 3.1 and 3.2, each histogram normalised by
/// itself; written here because Debian's OpenCV comes without xfeatures2d.
class Daisy {
 public:
  /// `grey`: CV_8UC1. Costs orientations x (rings + 1) blurred images.
  explicit Daisy(const cv::Mat& grey, const DaisyConfig& options = {});

  /// Values of a descriptor: (rings * ring_points + 1) * orientations.
  int size() const;
  /// Writes the descriptor at a pixel; beyond the image's edge the edge is repeated. Every
  /// histogram has length 1, or is zero where the image has no gradient.
  void Describe(int column, int row, float* descriptor) const;

 private:
  void AddHistogram(const std::vector<cv::Mat>& maps, float column, float row,
                    float* histogram) const;

  DaisyConfig options_;
  /// By blur, from the centre outwards, then by orientation; CV_32FC1.
  std::vector<std::vector<cv::Mat>> maps_;
  std::vector<cv::Point2f> places_;  ///< Of the ring's histograms, from the centre, ring by ring.
};

}  // namespace livemap::change
