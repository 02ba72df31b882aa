#pragma once

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "imaging/rectifier.h"

namespace livemap::imaging {

/// How depth is found from two cameras. Pixels are those of the images that are matched: with
/// `scale` 2 one of them is two of the camera's.
struct StereoConfig {
  double min_depth_m = 2.5;     ///< Sets how far the search goes; what is nearer is not recognised.
  double min_disparity_px = 1;  ///< Farther than this shift says is unknown; camera's pixels.
  int scale = 2;                ///< Matched on images smaller by this: 1, 2 or 4.
  int block_size = 5;           ///< Side of the compared blocks, odd, 1 to 21.
  int uniqueness_percent = 40;  ///< The best match beats the second by this, 0 to 100.
  int left_right_px = 1;        ///< Both cameras' matches agree within this, 0 to 100.
  int speckle_pixels = 100;     ///< Smaller islands of depth are taken out; 0: none is.
};

/// Throws Error naming the value and what is accepted.
void CheckStereoConfig(const StereoConfig& config);

/// Where the right camera is, as sensor_msgs/CameraInfo says it of a rectified pair.
struct StereoGeometry {
  double focal_px = 0;  ///< fx of both.
  double baseline_m =
      0;                 ///< Right camera beside the left one; P's fourth column is -fx * baseline.
  double offset_px = 0;  ///< Shift of what is infinitely far: cx of the left minus cx of the right.
};

/// From the calibrations of rectified images (Rectifier::output()). Throws Error naming what does
/// not make a pair: sizes, focal lengths or rows that differ, no baseline or one to the left.
StereoGeometry MakeStereoGeometry(const CameraCalibration& left, const CameraCalibration& right);

/// Depth by semi-global matching (Hirschmueller's, OpenCV's StereoSGBM) along the rows of rectified
/// pairs of one calibration. Keeps its buffers, so not thread-safe.
class StereoDepth {
 public:
  /// Longest search that is worked off, matched images' pixels; nor is one of more than half their
  /// width.
  static constexpr int kMaxSearchPx = 256;

  /// Throws Error naming a value of `config` and what is accepted, and what MakeStereoGeometry
  /// does.
  StereoDepth(const StereoConfig& config, const CameraCalibration& left,
              const CameraCalibration& right);

  /// Images as Rectifier::Apply returns them, CV_8UC1 or CV_8UC3 (BGR). Returns CV_32FC1, metres
  /// along the optical axis, registered to the left image, NaN where it is not known (REP 118).
  /// Throws Error when an image's size or type is another one.
  cv::Mat Compute(const cv::Mat& left, const cv::Mat& right);

  const StereoGeometry& geometry() const { return geometry_; }
  /// Shifts that are tried, matched images' pixels.
  int search_px() const { return search_px_; }

 private:
  /// `image` as grey values in `grey`, smaller by the scale, with room for the search on the left.
  void Prepare(const cv::Mat& image, const char* camera, cv::Mat& grey);
  /// The found shifts, of and in the full image's pixels; far negative where there is none.
  cv::Mat FullDisparity() const;

  const StereoConfig config_;
  const StereoGeometry geometry_;
  const cv::Size size_;
  cv::Size matched_;
  double step_px_ = 1;  ///< Of the full image per matched pixel.
  int search_px_ = 0;
  int first_px_ = 0;  ///< Shift that the search begins with.
  cv::Ptr<cv::StereoSGBM> matcher_;
  cv::Mat grey_, small_, left_, right_, found_;
};

}  // namespace livemap::imaging
