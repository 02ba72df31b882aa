#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace livemap::imaging {

/// A camera's calibration as sensor_msgs/CameraInfo states it: raw pixel = distort(K, D), rectified
/// pixel = P applied to the ray turned by R. Pixels, (0, 0) the centre of the first pixel.
struct CameraCalibration {
  int width = 0;
  int height = 0;
  std::string distortion_model;    ///< "", "plumb_bob", "rational_polynomial" or "equidistant".
  std::vector<double> distortion;  ///< Coefficients of the model; empty or zeros: none.
  cv::Matx33d k = cv::Matx33d::zeros();
  cv::Matx33d r = cv::Matx33d::eye();
  cv::Matx34d p = cv::Matx34d::zeros();  ///< All zeros: rectify into K.

  friend bool operator==(const CameraCalibration& a, const CameraCalibration& b);
  friend bool operator!=(const CameraCalibration& a, const CameraCalibration& b) {
    return !(a == b);
  }
};

/// Wanted size of the output; zero keeps the input's. With only one given the other follows the
/// aspect ratio.
struct OutputSize {
  int width = 0;
  int height = 0;
};

/// Takes the lens distortion out of images of one calibration and resizes them. Immutable, its maps
/// computed once, so that threads may share it.
class Rectifier {
 public:
  /// Throws Error naming the value when the calibration cannot be used: size not positive or above
  /// `kMaxSide`, focal length not positive, anything not finite, unknown distortion model.
  Rectifier(const CameraCalibration& calibration, OutputSize output_size);

  static constexpr int kMaxSide = 16384;

  /// True when the image needs no change: the caller passes its pointer on.
  bool is_identity() const { return !remaps_ && !resizes_; }
  const CameraCalibration& input() const { return input_; }
  /// Of the images that Apply returns: no distortion, R = I, K = left part of P. With a resize by
  /// (sx, sy): fx' = sx fx, cx' = sx (cx + 0.5) - 0.5, as pixel centres lie at integers.
  const CameraCalibration& output() const { return output_; }

  /// `image` must have the input's size. Pixels that look past the raw image are black.
  cv::Mat Apply(const cv::Mat& image) const;

 private:
  void ComputeMaps();

  CameraCalibration input_;
  CameraCalibration output_;
  cv::Matx33d rectified_k_;  ///< Of the rectified image before the resize.
  bool remaps_ = false;
  bool resizes_ = false;
  cv::Mat map_xy_;
  cv::Mat map_fraction_;
};

}  // namespace livemap::imaging
