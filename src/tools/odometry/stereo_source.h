#pragma once

#include <opencv2/core.hpp>

#include "datasets/sequences.h"
#include "imaging/stereo_depth.h"

namespace livemap::tools {

/// The stereo camera of a recorded sequence, whose pictures are rectified: depth by the code that
/// camera_ingest runs.
class StereoSource {
 public:
  /// `intrinsics` with width and height. Throws Error when the sequence has no right camera, or
  /// one that misses a picture.
  StereoSource(const datasets::Sequence& sequence, const geo::CameraIntrinsics& intrinsics,
               const imaging::StereoConfig& config);

  /// Depth of the frame in metres, NaN where unknown; `left` is its decoded picture, BGR. Throws
  /// Error naming a picture that is missing, corrupt or of another size.
  cv::Mat Depth(const datasets::SequenceFrame& frame, const cv::Mat& left);
  /// What the last depth took, decoding not included.
  double milliseconds() const { return milliseconds_; }

 private:
  imaging::StereoDepth stereo_;
  geo::CameraIntrinsics intrinsics_;
  double milliseconds_ = 0;
};

}  // namespace livemap::tools
